"""python3 -m handsim export ... .usda, read back by usd-core."""
import csv
import math

import numpy as np
import pytest

import handsim as hs
from handsim import export
from handsim._model import bent, matrices, skins_of
from handsim._usd import usda_of

try:
    from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdSkel
except ImportError:
    Usd = None
# A mark, and no skip of the module: pytest ends with status 5 where it collects nothing.
pytestmark = pytest.mark.skipif(Usd is None, reason="usd-core is missing: pip install usd-core")

SCENES = ["two_hands", "grasp_power_can", "slider_crank_iftomm", "object_collection"]


@pytest.fixture(scope="module", params=SCENES)
def written(request, tmp_path_factory):
    scene = hs.load(request.param)
    sim = hs.Simulation(scene)
    poses = np.concatenate([sim.bodies.position, sim.bodies.quaternion], axis=1)
    path = tmp_path_factory.mktemp("usd") / "scene.usda"
    path.write_text(usda_of(scene._model, skins_of(scene._core), poses))
    return scene._model, skins_of(scene._core), poses, Usd.Stage.Open(str(path))


def prim(stage, name):
    return stage.GetPrimAtPath("/World/" + name.replace(".", "_").replace(" ", "_"))


def pose_matrix(transform):
    """USD's vectors are rows."""
    return np.array(transform).T


# Oracle: the model. Masses are float32 in UsdPhysics.
def test_bodies_have_their_masses_inertias_and_poses(written):
    model, _, poses, stage = written
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 1
    for body, x in zip(model.bodies[1:], poses[1:]):
        of = prim(stage, body.name)
        mass = UsdPhysics.MassAPI(of)
        assert mass.GetMassAttr().Get() == np.float32(body.mass)
        turn = Gf.Matrix3d(mass.GetPrincipalAxesAttr().Get())
        axes = np.array(turn).T
        inertia = axes @ np.diag(np.array(mass.GetDiagonalInertiaAttr().Get())) @ axes.T
        assert np.allclose(inertia, body.inertia, rtol=1e-6, atol=1e-6 * body.inertia.max())
        assert bool(UsdPhysics.RigidBodyAPI(of).GetKinematicEnabledAttr().Get()) == body.fixed
        assert np.allclose(pose_matrix(UsdGeom.Xformable(of).ComputeLocalToWorldTransform(0)), matrices(x), atol=1e-8)


# Oracle: the model: kinds, centres, axes and limits in the frames of both bodies.
def test_joints_have_their_axes_and_limits(written):
    model, _, _, stage = written
    kinds = {"hinge": "PhysicsRevoluteJoint", "universal": "PhysicsJoint", "ball": "PhysicsSphericalJoint", "slider": "PhysicsPrismaticJoint"}
    for joint in model.joints:
        of = prim(stage, joint.name)
        assert of.GetTypeName() == kinds[joint.kind]
        base = UsdPhysics.Joint(of)
        assert [str(path) for path in base.GetBody1Rel().GetTargets()] == [str(prim(stage, model.bodies[joint.child].name).GetPath())]
        for frame, place, turn in ((joint.parent_frame, base.GetLocalPos0Attr(), base.GetLocalRot0Attr()),
                                   (joint.child_frame, base.GetLocalPos1Attr(), base.GetLocalRot1Attr())):
            assert np.allclose(place.Get(), frame[:3], atol=1e-7)
            axes = np.array(Gf.Matrix3d(Gf.Quatd(turn.Get()))).T
            for column, axis in zip(axes.T, joint.axes):
                exact = matrices(frame)[:3, :3] @ axis.axis
                # The second axis only as far as it is normal to the first.
                assert np.allclose(column, exact, atol=1e-6) or (axis is joint.axes[1] and column @ exact > 0.95), joint.name
        scale = 1 if joint.kind == "slider" else 180 / math.pi
        if joint.kind in ("hinge", "slider"):
            single = (UsdPhysics.RevoluteJoint if joint.kind == "hinge" else UsdPhysics.PrismaticJoint)(of)
            found = [(single.GetLowerLimitAttr().Get(), single.GetUpperLimitAttr().Get())]
        else:
            limits = [UsdPhysics.LimitAPI.Get(of, word) for word in ("rotX", "rotY")] if joint.axes else []
            found = [(each.GetLowAttr().Get(), each.GetHighAttr().Get()) for each in limits]
        for (low, high), axis in zip(found, joint.axes):
            if math.isfinite(axis.low):
                assert (low, high) == pytest.approx((scale * axis.low, scale * axis.high), rel=1e-6, abs=1e-6)
        if joint.kind == "universal":
            locked = [UsdPhysics.LimitAPI.Get(of, word) for word in ("transX", "transY", "transZ", "rotZ")]
            assert all(each.GetLowAttr().Get() > each.GetHighAttr().Get() for each in locked)


# Oracle: the model's shapes, one prim each.
def test_shapes_are_colliders_of_their_size(written):
    model, _, _, stage = written
    found = [of for of in stage.Traverse() if of.HasAPI(UsdPhysics.CollisionAPI)]
    assert len(found) == len(model.shapes)
    for shape in model.shapes:
        name = "/World/" if shape.body == 0 else str(prim(stage, model.bodies[shape.body].name).GetPath()) + "/"
        like = [of for of in found if str(of.GetPath().GetParentPath()) + "/" == name]
        assert like
        if shape.kind in ("capsule", "cylinder", "sphere"):
            assert any(of.GetAttribute("radius").Get() == pytest.approx(shape.radius, rel=1e-8) and
                       (shape.kind == "sphere" or of.GetAttribute("height").Get() == pytest.approx(shape.length, rel=1e-8)) for of in like)
        if shape.kind == "box":
            assert any(np.allclose(of.GetAttribute("xformOp:scale").Get() or 0, shape.edges, rtol=1e-6) for of in like)


# Oracle: UsdSkel's own skinning; where a point has one body it is where that body is.
def test_skin_is_where_the_bodies_are(written):
    _, skins, poses, stage = written
    roots = [UsdSkel.Root(of) for of in stage.Traverse() if of.IsA(UsdSkel.Root)]
    assert len(roots) == len(skins)
    for root, skin in zip(roots, skins):
        cache = UsdSkel.Cache()
        cache.Populate(root, Usd.PrimDefaultPredicate)
        binding = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)[0]
        skeleton = cache.GetSkelQuery(binding.GetSkeleton())
        target = binding.GetSkinningTargets()[0]
        assert skeleton.GetTopology().Validate()[0]
        points = UsdGeom.Mesh(target.GetPrim()).GetPointsAttr().Get()
        assert target.ComputeSkinnedPoints(skeleton.ComputeSkinningTransforms(0), points, 0)
        rigid = skin.weights.max(axis=1) > 1 - 1e-6
        exact = bent(skin, poses[skin.bodies])
        assert np.count_nonzero(rigid) > 500 and np.abs(np.array(points) - exact)[rigid].max() < 1e-6
        assert np.abs(np.array(points) - exact).max() < 0.006


def from_csv(folder):
    """Times, and position and rotation matrix of each body by time, read without the package."""
    with open(folder / "trajectory.csv") as file:
        rows = [{key.partition("[")[0]: value for key, value in row.items()} for row in csv.DictReader(file)]
    names = [key[:-3] for key in rows[0] if key.endswith(".qw")]
    values = lambda name, keys: np.array([[float(row[f"{name}.{key}"]) for key in keys] for row in rows])
    return np.array([float(row["time"]) for row in rows]), {name: (values(name, "xyz"), values(name, ["qw", "qx", "qy", "qz"])) for name in names}


def joint_places(stage, root, code):
    """Of the joints of a skin in the world, by name."""
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    binding = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)[0]
    query = cache.GetSkelQuery(binding.GetSkeleton())
    places = query.ComputeJointWorldTransforms(UsdGeom.XformCache(code))
    return {str(token).rpartition("/")[2]: np.array(m.ExtractTranslation()) for token, m in zip(query.GetJointOrder(), places)}


# Oracle: the table of the run. Joints are where bodies' proximal joints are, which lie half a segment from them, as at the start.
def test_a_run_moves_bodies_and_joints_as_its_table_says(tmp_path):
    folder, file = tmp_path / "run", tmp_path / "run.usda"
    assert hs._core.command_line(["run", str(hs.data_path() / "config/grasp_power_can.yaml"), "--out", str(folder), "--quiet", "--set", "duration=1.2"]) in (0, 1)
    assert export.main([str(folder), "--out", str(file), "--quiet", "--fps", "50"]) == 0
    times, bodies = from_csv(folder)
    stage = Usd.Stage.Open(str(file))
    rate = stage.GetTimeCodesPerSecond()
    assert (rate, stage.GetStartTimeCode(), stage.GetEndTimeCode() / rate) == (50, 0, pytest.approx(times[-1] - times[0]))
    sampled = np.array(UsdGeom.Xformable(prim(stage, "can")).GetTimeSamples()) / rate
    assert len(sampled) == len(times) == 61 and sampled == pytest.approx(times - times[0], abs=1e-7)
    root = UsdSkel.Root(prim(stage, "right_skin"))
    local, moved = {}, 0.0
    for row in range(0, len(times), 5):
        code = Usd.TimeCode(rate * sampled[row])
        for name, (places, turns) in bodies.items():
            transform = UsdGeom.Xformable(prim(stage, name)).ComputeLocalToWorldTransform(code)
            assert np.abs(np.array(transform.ExtractTranslation()) - places[row]).max() < 1e-7
            quaternion = transform.ExtractRotationQuat()
            dot = abs(np.dot([quaternion.GetReal(), *quaternion.GetImaginary()], turns[row]))
            assert dot == pytest.approx(1, abs=1e-8)
        for joint, place in joint_places(stage, root, code).items():
            x, (w, *v) = (column[row] for column in bodies[f"right.{joint}"])
            # The joint in the frame of its body stays where it was.
            arm = place - x
            cross = 2 * np.cross(arm, v)
            inside = arm + w * cross + np.cross(cross, v)
            start = local.setdefault(joint, (inside, place))
            assert np.abs(inside - start[0]).max() < 2e-6, joint
            moved = max(moved, np.linalg.norm(place - start[1]))
    assert moved > 0.05


def test_a_moment_of_a_run_has_no_motion(tmp_path):
    file = tmp_path / "moment.usda"
    assert export.main(["two_hands", "--time", "0", "--out", str(file), "--quiet"]) == 0
    stage = Usd.Stage.Open(str(file))
    assert not stage.HasAuthoredTimeCodeRange()
    assert not any(attribute.GetNumTimeSamples() for of in stage.Traverse() for attribute in of.GetAttributes())
