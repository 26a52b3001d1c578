"""Kinematics and dynamics of a hand as functions of arrays."""
import numpy as np
import pytest

import handsim as hs

GRAVITY = (0, 0, -9.81)


@pytest.fixture(scope="module", params=["right", "left"])
def hand(request):
    return hs.Hand(stature=1.75, mass=72, sex="male", side=request.param, muscles=True)


@pytest.fixture(scope="module")
def motion(hand):
    """Coordinates within their stops, rates and accelerations."""
    random = np.random.default_rng(1)
    low, high = hand.joints["low"], hand.joints["high"]
    n = len(hand.coordinates)
    return low + (high - low) * random.random(n), random.normal(size=n), 10 * random.normal(size=n)


def rotation(quaternion):
    w, x, y, z = quaternion
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def derivative(function, q, step=1e-6):
    """Central differences: the last axis is that of the coordinates."""
    return np.stack([(function(q + step * e) - function(q - step * e)) / (2 * step) for e in np.eye(len(q))], axis=-1)


# Oracle: topology and the definition of a mean: each edge has a triangle on either side, vertices move with their body.
def test_skin_is_closed_and_moves_with_its_bodies(hand, motion):
    mesh, bent = hand.mesh(), hand.mesh(motion[0])
    assert mesh.faces.max() == len(mesh.vertices) - 1 and mesh.weights.shape == (len(mesh.vertices), len(hand.bodies))
    edges = {(int(face[k]), int(face[(k + 1) % 3])) for face in mesh.faces for k in range(3)}
    assert len(edges) == mesh.faces.size and all((b, a) in edges for a, b in edges)
    assert np.allclose(mesh.weights.sum(axis=1), 1, atol=1e-6)
    straight, now = hand.poses(np.zeros(len(hand.coordinates))), hand.poses(motion[0])
    body = hand.bodies.index("thumb_distal")
    rigid = mesh.weights[:, body] > 1 - 1e-6
    assert np.count_nonzero(rigid) > 50
    local = (mesh.vertices[rigid] - straight.position[body]) @ rotation(straight.quaternion[body])
    # Weights are in single precision.
    assert np.allclose(now.position[body] + local @ rotation(now.quaternion[body]).T, bent.vertices[rigid], atol=1e-6)


# Oracle: the tables, which are of straight fingers.
def test_poses_at_zero_are_those_of_the_tables(hand):
    poses = hand.poses(np.zeros(len(hand.coordinates)))
    assert poses.position.shape == (16, 3) and poses.quaternion.shape == (16, 4)
    assert np.allclose(poses.position, hand.segments["centre_of_mass"], atol=1e-15)
    parents = dict(zip(hand.bodies, hand.segments["parent"]))
    assert parents["palm"] == -1 and parents["index_middle"] == hand.bodies.index("index_proximal")


# Oracle: the tables: the middle finger lies along y, its segments one after the other.
def test_a_fingertip_is_at_the_end_of_its_segments(hand):
    base = hand.joints["centre"][list(hand.joints["name"]).index("middle_mcp.flexion")]
    length = sum(row["length"] for row in hand.segments.each() if row["name"].startswith("middle_"))
    tip = hand.position(np.zeros(len(hand.coordinates)), "middle_tip")
    assert np.allclose(tip, base + [0, length, 0], atol=1e-15)
    assert list(hand.tips["name"]) == [f"{f}_tip" for f in ("thumb", "index", "middle", "ring", "little")]


# Oracle: a point of a body, placed by the body's pose.
def test_a_position_is_that_of_the_point_on_its_body(hand, motion):
    q, _, _ = motion
    poses, tip = hand.poses(q), hand.tips.row(1)
    body = hand.bodies.index(tip["body"])
    there = poses.position[body] + rotation(poses.quaternion[body]) @ tip["position"]
    assert np.allclose(hand.position(q, "index_tip"), there, atol=1e-15)
    assert np.allclose(hand.position(q, (tip["body"], tip["position"])), there, atol=1e-15)
    assert np.allclose(hand.position(q, "index_distal"), poses.position[body], atol=1e-15)


# Oracle: central differences of the positions and orientations; bound: their error of second order.
@pytest.mark.parametrize("point", ["index_tip", "thumb_tip", "palm", ("little_middle", (0.01, 0.02, -0.01))])
def test_a_jacobian_is_the_derivative_of_the_position(hand, motion, point):
    q, _, _ = motion
    jacobian = hand.jacobian(q, point)
    assert jacobian.shape == (6, len(q))
    assert np.allclose(jacobian[:3], derivative(lambda x: hand.position(x, point), q), atol=1e-9)
    if point == "index_tip":
        body = hand.bodies.index("index_distal")
        turns = derivative(lambda x: rotation(hand.poses(x).quaternion[body]), q)
        now = rotation(hand.poses(q).quaternion[body])
        for k in range(len(q)):
            spin = turns[:, :, k] @ now.T
            assert np.allclose(jacobian[3:, k], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-9)


# Oracle: kinetic energy from the Jacobians of all bodies; columns of inverse dynamics.
def test_the_mass_matrix_is_that_of_the_bodies(hand, motion):
    q, _, _ = motion
    poses, n = hand.poses(q), len(q)
    expected = np.zeros((n, n))
    for i, body in enumerate(hand.bodies):
        jacobian, axes = hand.jacobian(q, body), rotation(poses.quaternion[i])
        # The table has the diagonal of the inertia; only a palm's, which does not move, has more.
        inertia = axes @ np.diag(hand.segments["inertia"][i]) @ axes.T
        expected += hand.segments["mass"][i] * jacobian[:3].T @ jacobian[:3] + jacobian[3:].T @ inertia @ jacobian[3:]
    mass = hand.mass_matrix(q)
    assert np.allclose(mass, expected, rtol=0, atol=1e-14 * np.abs(mass).max())
    columns = [hand.inverse_dynamics(q, np.zeros(n), e, gravity=(0, 0, 0)) for e in np.eye(n)]
    assert np.allclose(mass, np.transpose(columns), rtol=0, atol=1e-14 * np.abs(mass).max())
    assert np.all(np.linalg.eigvalsh(mass) > 0)


# Oracle: conservation: the power of the torques is the rate of change of kinetic and potential energy.
def test_inverse_dynamics_does_the_work_that_energy_gains(hand, motion):
    q, u, a = motion

    def energy(t):
        x, v = q + t * u + t * t / 2 * a, u + t * a
        return v @ hand.mass_matrix(x) @ v / 2 - hand.segments["mass"] @ hand.poses(x).position @ np.array(GRAVITY)

    power = hand.inverse_dynamics(q, u, a, gravity=GRAVITY) @ u
    assert power == pytest.approx((energy(1e-5) - energy(-1e-5)) / 2e-5, rel=1e-6)


# Oracle: signs of anatomy: flexors flex, extensors extend; the deep flexor passes all joints of its finger.
def test_moment_arms_have_the_signs_of_anatomy(hand):
    arms = hand.moment_arms(np.full(len(hand.coordinates), 0.1))
    assert arms.shape == (len(hand.muscles), len(hand.coordinates))
    column = {name: k for k, name in enumerate(hand.coordinates)}
    flexor, extensor = hand.muscles.index("FDP2"), hand.muscles.index("EDC2")
    for joint in ("index_mcp", "index_pip", "index_dip"):
        assert arms[flexor, column[f"{joint}.flexion"]] > 0.003
        assert arms[extensor, column[f"{joint}.flexion"]] < 0
    assert arms[flexor, column["little_mcp.flexion"]] == 0


def test_shapes_are_where_their_bodies_are(hand):
    shapes = hand.shapes
    assert set(shapes["body"]) == set(hand.bodies)
    row = shapes.row(list(shapes["name"]).index("index_distal"))
    end = row["position"] + rotation(row["quaternion"]) @ (0, 0, row["length"] / 2 + row["radius"])
    tip = hand.tips.row(1)["position"]
    assert row["kind"] == "capsule" and np.allclose(end, tip, atol=1e-15)


def test_what_does_not_fit_is_refused_by_name():
    hand = hs.Hand(stature=1.75, mass=72)
    q = np.zeros(len(hand.coordinates))
    with pytest.raises(hs.Error, match=r"q: got shape \(3,\)"):
        hand.poses(np.zeros(3))
    with pytest.raises(hs.Error, match="point: got pinky_tip, need one of thumb_tip, "):
        hand.jacobian(q, "pinky_tip")
    with pytest.raises(hs.Error, match="offset: got shape"):
        hand.jacobian(q, ("palm", (1, 2)))
    with pytest.raises(hs.Error, match="u: got shape"):
        hand.inverse_dynamics(q, q[1:], q)
    with pytest.raises(hs.Error, match="need Hand\\(..., muscles=True\\)"):
        hand.moment_arms(q)
    assert hand.muscles == []


# Oracle: Pinocchio, on the exported URDF. Bound: rounding, which includes that of angles and numbers in the file.
@pytest.mark.parametrize("model", ["anatomical", "prototype"])
def test_pinocchio_agrees_on_the_exported_hand(model):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed (pip install pin)")
    hand = hs.Hand(stature=1.75, mass=72, sex="female", model=model)
    other = pin.buildModelFromXML(hand.to_urdf())
    other.gravity.linear = np.array(GRAVITY)
    for i, inertia in enumerate(other.inertias):
        # A universal joint has a link in its middle, to which URDF gives a mass.
        if inertia.mass == 1e-12:
            other.inertias[i] = pin.Inertia.Zero()
    data = other.createData()
    order = [other.joints[other.getJointId(f"right.{name}")].idx_v for name in hand.coordinates]
    random = np.random.default_rng(2)
    wrist = np.array([0, 0, 0.2])  # the hand's place in its scene

    def there(values):
        out = np.zeros(other.nv)
        out[order] = values
        return out

    for _ in range(20):
        q, u, a = (random.uniform(-1, 1, len(order)) * size for size in (1, 5, 50))
        pin.framesForwardKinematics(other, data, there(q))
        mass, tau = hand.mass_matrix(q), hand.inverse_dynamics(q, u, a, gravity=GRAVITY)
        theirs = np.array(pin.crba(other, data, there(q)))
        theirs = np.triu(theirs) + np.triu(theirs, 1).T
        assert np.abs(mass - theirs[np.ix_(order, order)]).max() < 1e-12 * np.abs(mass).max()
        expected = pin.rnea(other, data, there(q), there(u), there(a))[order]
        assert np.abs(tau - expected).max() < 1e-12 * np.abs(tau).max()
        poses = hand.poses(q)
        for i, body in enumerate(hand.bodies):
            frame = other.getFrameId(f"right.{body}")
            place = data.oMf[frame]
            offset = rotation(poses.quaternion[i]).T @ (place.translation - wrist - poses.position[i])
            jacobian = hand.jacobian(q, (body, offset))
            expected = pin.computeFrameJacobian(other, data, there(q), frame, pin.LOCAL_WORLD_ALIGNED)[:, order]
            assert np.abs(jacobian - expected).max() < 1e-12, body
            inertia = other.inertias[other.frames[frame].parentJoint] if i > 0 else None
            if inertia is not None:
                centre = data.oMi[other.frames[frame].parentJoint].act(inertia.lever)
                assert np.abs(centre - wrist - poses.position[i]).max() < 1e-12, body
