"""Simulations, step by step."""
import pickle
import threading

import numpy as np
import pytest

import handsim as hs


# Oracle: the trajectory of the scene's own run, to the bit.
def test_steps_are_those_of_the_run(two_hands):
    trajectory = two_hands.run(frames=0).trajectory
    simulation = hs.Simulation(two_hands)
    for row in range(1, 21):
        simulation.step(substeps=10)
        q = np.array([trajectory[name][row] for name in two_hands.coordinates])
        assert np.array_equal(simulation.q, q)
    assert simulation.steps == 200 and simulation.time == pytest.approx(0.2)


# Oracle: weight and Newton's third law: the ball at rest presses on the ground with m g.
def test_contacts_carry_the_weight(balls):
    simulation = hs.Simulation(balls)
    simulation.step(substeps=300)
    contacts = simulation.contacts
    assert len(contacts.a) == contacts.force.shape[0] == 1
    sign = 1 if contacts.a[0].startswith("low") else -1
    assert sign * contacts.force[0] == pytest.approx([0, 0, 0.1 * 9.80665], abs=1e-6)
    assert contacts.position[0] == pytest.approx([0, 0, 0], abs=1e-4)


# Oracle: free fall with a given force: the articulated engine's semi-implicit Euler adds h (f/m - g) a step.
def test_forces_accelerate_bodies(balls):
    simulation = hs.Simulation(balls)
    simulation.step(forces={"high": [0.6, 0, 0]}, substeps=100)
    bodies = simulation.bodies
    at = balls.bodies.index("high")
    assert bodies.velocity[at] == pytest.approx([0.1 * 0.6 / 0.2, 0, -0.1 * 9.80665], rel=1e-9)
    simulation.step(forces={"high": [0, 0, 0, 0, 0, 1e-4]}, substeps=100)
    moment_of_inertia = 0.4 * 0.2 * 0.03**2
    assert simulation.bodies.angular_velocity[at][2] == pytest.approx(1e-4 * 0.1 / moment_of_inertia, rel=1e-9)


# Oracle: the sign that the class documents: a positive torque flexes.
def test_a_torque_moves_its_joint_along_its_coordinate(two_hands):
    still, pushed = hs.Simulation(two_hands), hs.Simulation(two_hands)
    torques = np.zeros(40)
    at = two_hands.coordinates.index("right.middle_pip.flexion")
    torques[at] = 0.01
    still.step(substeps=20)
    pushed.step(torques, substeps=20)
    assert pushed.u[at] > still.u[at] + 0.1


# Oracle: the controller's steady error of every_pose's criterion is 0.5 degrees.
def test_targets_are_reached():
    scene = hs.load("every_pose", engine="articulated")
    simulation = hs.Simulation(scene)
    targets = scene.limits[scene.axis_coordinates].mean(axis=1)
    simulation.step(targets=targets, substeps=2000)
    assert simulation.q[scene.axis_coordinates] == pytest.approx(targets, abs=np.radians(0.5))


# Oracle: the pose that was asked for; half of the way after half of the substeps.
def test_a_driven_wrist_goes_where_it_is_told(can):
    simulation = hs.Simulation(can)
    at = can.bodies.index(can.wrists[0])
    start = simulation.bodies
    turn = np.array([np.cos(0.1), 0, 0, np.sin(0.1)])
    w, x, y, z = start.quaternion[at]
    goal = np.array([turn[0] * w - turn[3] * z, turn[0] * x - turn[3] * y, turn[0] * y + turn[3] * x,
                     turn[0] * z + turn[3] * w])
    # The hand frame's axes are the palm's.
    simulation.step(wrists=[[0, 0, 0.5, *goal]], substeps=50)
    assert abs(simulation.bodies.quaternion[at] @ goal) == pytest.approx(1, abs=1e-12)
    rate = 0.2 / (50 * can.step)
    assert simulation.bodies.angular_velocity[at] == pytest.approx([0, 0, rate], abs=1e-9)


# Oracle: the same steps from the same place have the same bits; also in another process by way of bytes.
def test_snapshots_and_motions_continue_with_the_same_bits(can):
    first = hs.Simulation(can, watch=True)
    first.step(substeps=300)
    snapshot, motion = pickle.loads(pickle.dumps(first.snapshot())), first.motion()
    assert snapshot.time == motion.time == first.time
    first.step(substeps=100)
    expected = first.q.copy()
    first.restore(snapshot)
    first.step(substeps=100)
    assert np.array_equal(first.q, expected)
    second = hs.Simulation(pickle.loads(pickle.dumps(can)), watch=True)
    second.restore(snapshot)
    second.step(substeps=100)
    assert np.array_equal(second.q, expected)
    first.reset(motion)
    first.step(substeps=100)
    assert np.array_equal(first.q, expected)
    with pytest.raises(hs.Error, match="scene|part|differ"):
        hs.Simulation("two_hands", watch=True).restore(snapshot)


# Oracle: the numbers given.
def test_a_reset_takes_coordinates_and_rates(two_hands):
    simulation = hs.Simulation(two_hands)
    start = simulation.q.copy()
    simulation.step(substeps=50)
    q = np.full(40, 0.1)
    simulation.reset(q=q, u=np.full(40, 2.0))
    assert simulation.q == pytest.approx(q, abs=1e-12) and simulation.u == pytest.approx(2.0, abs=1e-9)
    assert simulation.time == 0
    simulation.reset()
    assert simulation.q == pytest.approx(start, abs=1e-12)


@pytest.mark.parametrize("torques, got", [
    (np.zeros(39), r"shape \(39,\), dtype float64"), (np.zeros((40, 1)), r"shape \(40, 1\), dtype float64"),
    (np.zeros(40, complex), r"shape \(40,\), dtype complex128"), (np.zeros(40, bool), r"shape \(40,\), dtype bool"),
    (["a"] * 40, r"shape \(40,\), dtype <U1"), (np.array(3.0), r"shape \(\), dtype float64")])
def test_a_wrong_shape_or_dtype_says_both(two_hands, torques, got):
    simulation = hs.Simulation(two_hands)
    before = simulation.q.copy()
    with pytest.raises(hs.Error, match=rf"torques: got {got}, need shape \(40,\), dtype float64"):
        simulation.step(torques)
    assert np.array_equal(simulation.q, before) and simulation.steps == 0


@pytest.mark.parametrize("torques", [np.full(40, 0.002, np.float32), [0] * 40, np.zeros(80)[::2]])
def test_other_real_numbers_are_converted(two_hands, torques):
    given, exact = hs.Simulation(two_hands), hs.Simulation(two_hands)
    given.step(torques, substeps=5)
    exact.step(np.array(torques, float), substeps=5)
    assert np.array_equal(given.q, exact.q)


def test_numbers_that_are_not_finite_and_unknown_bodies_are_refused(two_hands, balls):
    with pytest.raises(hs.Error, match="finite|nan"):
        hs.Simulation(two_hands).step(np.full(40, np.nan))
    with pytest.raises(hs.Error, match="forces: got hihg, need .*nearest: high"):
        hs.Simulation(balls).step(forces={"hihg": [0, 0, 1]})
    with pytest.raises(hs.Error, match=r"substeps: got 0, need a whole number, 1 to"):
        hs.Simulation(balls).step(substeps=0)


# Oracle: the motion of each simulation alone.
def test_two_threads_step_a_simulation_each(two_hands):
    alone = hs.Simulation(two_hands)
    alone.step(substeps=2000)
    both = [hs.Simulation(two_hands) for _ in range(2)]

    def work(simulation):
        for _ in range(200):
            simulation.step(substeps=10)

    threads = [threading.Thread(target=work, args=(each,)) for each in both]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for each in both:
        assert np.array_equal(each.q, alone.q)


# Oracle: another thread that counts while one call steps for long: it cannot if the call keeps the GIL.
def test_stepping_releases_the_gil(two_hands):
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            stop.wait(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    simulation = hs.Simulation(two_hands)
    before = counted[0]
    simulation.step(substeps=100_000)
    during = counted[0] - before
    stop.set()
    thread.join()
    assert during > 10


def test_a_view_keeps_its_simulation_alive(two_hands):
    simulation = hs.Simulation(two_hands)
    simulation.step(substeps=20)
    q, expected = simulation.q, simulation.q.copy()
    del simulation
    junk = [np.zeros(40) for _ in range(1000)]
    assert np.array_equal(q, expected) and len(junk) == 1000
    with pytest.raises(ValueError):
        q[0] = 1
