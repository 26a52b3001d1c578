"""Smoothed derivatives: a fingertip above a ball, against sums over the disturbance; how they become the exact ones."""
import handsim as hs
import numpy as np
import pytest
from handsim import optimise

DATA = hs.data_path()
SCENE = {"hands": [{"model": str(DATA / "handmodels" / "anatomical.yaml"),
                    "person": {"stature": 1.755, "mass": 78.4, "sex": "male"}, "side": "right",
                    "wrist": {"mount": "fixed", "position": [0, 0, 0]}}],
         "objects": [{"name": "ball", "shape": "sphere", "radius": 0.02, "mass": 0.1, "position": [0, 0, -0.1]}],
         "control": {"controller": {"form": "implicit", "gains": [{"joints": "all", "proportional": 1, "derivative": 0.02,
                                                                   "torque_limit": 1}]},
                     "poses": {"poses": {"flat": {}}, "programs": {"hold": {"keys": [{"time": 0, "pose": "flat"}]}}},
                     "program": "hold"},
         "contacts": {"materials": [{"name": "pad", "file": str(DATA / "handmodels" / "finger_pad.yaml")}],
                      "rules": [{"between": ["hands", "objects"], "material": "pad"}]},
         "effects": ["actuation", "object_contact", "friction"], "solver": {"engine": "articulated", "step": 1e-3}, "duration": 1}
DEVIATION = 2e-4


class Tip:
    """The index fingertip of a hand at rest, and a ball below it."""

    def __init__(self):
        self.sim = hs.Simulation(SCENE)
        self.tip = self.sim.bodies.position[self.sim.scene.bodies.index("right.index_distal")]
        low, high = self.tip[2] - 0.06, self.tip[2] - 0.01
        for _ in range(60):
            self.place(0.5 * (low + high))
            self.sim.step()
            low, high = (low, 0.5 * (low + high)) if len(self.sim.contacts.depth) else (0.5 * (low + high), high)
        self.top = low
        self.place(self.top)
        names = self.sim.derivatives().names
        self.joint, self.rate = names.index("right.index_mcp.flexion"), names.index("d(ball.shift.z)/dt")
        self.target = self.sim.scene.axes.index("right.index_mcp.flexion")
        self.size = len(names)

    def place(self, z):
        self.sim.reset(objects=[[self.tip[0], self.tip[1], z, 1, 0, 0, 0]])

    def above(self, gap):
        self.place(self.top - gap)
        return self.sim


@pytest.fixture(scope="module")
def tip():
    return Tip()


def test_a_tip_just_above_a_ball_moves_it_in_the_mean_only(tip):
    sim = tip.above(2e-4)
    exact = sim.derivatives()
    smooth = sim.derivatives(smoothing=DEVIATION)
    assert exact.targets[tip.rate, tip.target] == 0 and exact.state[tip.rate, tip.joint] == 0
    # Bending pushes the ball down.
    assert smooth.targets[tip.rate, tip.target] < -1e-3 and smooth.state[tip.rate, tip.joint] < -0.1
    # Ten deviations away from the contact nothing is left of it.
    assert sim.derivatives(smoothing=DEVIATION / 10).targets[tip.rate, tip.target] == 0


@pytest.mark.parametrize("gap, speed", [(2e-4, 0), (-5e-5, 0), (2e-4, 2)])
def test_smoothed_derivatives_are_those_of_the_mean(tip, gap, speed):
    """Of one disturbed angle, the mean is a sum over steps; with a speed the ball's rate jumps where they meet."""
    sim = tip.above(gap)
    rates = np.zeros(len(sim.q))
    rates[tip.joint] = speed
    start = np.zeros(len(sim.q))
    ball = [[*sim.bodies.position[-1], 1, 0, 0, 0]]
    deviation, share = DEVIATION / 0.1, 0.05
    nodes = np.arange(-8, 8 + share, share / 10) * deviation
    targets = np.zeros(len(sim.scene.axes))

    def ends(target):
        """The ball's rate after each step, and its derivative by the angle."""
        targets[tip.target] = target
        out = []
        for node in nodes:
            start[tip.joint] = node
            sim.reset(q=start, u=rates, objects=ball)
            slope = sim.derivatives(targets=targets, advance=True).state[tip.rate, tip.joint]
            out.append((sim.bodies.velocity[-1, 2], slope))
        return np.array(out).T

    def mean(of, shift=0.0):
        weight = np.exp(-0.5 * ((nodes - shift) / deviation) ** 2)
        return weight @ of / weight.sum()
    (undisturbed, slopes), h = ends(0.0), share * deviation
    by_joint = (8 * (mean(undisturbed, h) - mean(undisturbed, -h)) - (mean(undisturbed, 2 * h) - mean(undisturbed, -2 * h))) / (12 * h)
    by_target = (mean(ends(1e-4)[0]) - mean(ends(-1e-4)[0])) / 2e-4

    sim.reset(q=np.zeros(len(sim.q)), u=rates, objects=ball)
    deviations = np.zeros(tip.size)
    deviations[tip.joint] = deviation
    found = []
    for seed in range(12):
        of = sim.derivatives(targets=np.zeros(len(targets)), smoothing=hs.Smoothing(deviations, 500, seed))
        found.append((of.state[tip.rate, tip.joint], of.targets[tip.rate, tip.target]))
    error = np.std(found, axis=0, ddof=1) / np.sqrt(len(found))
    assert (np.abs(np.mean(found, axis=0) - [by_joint, by_target]) < 4 * error).all()
    if speed:  # their mean alone does not know of the jump
        assert abs(mean(slopes)) < abs(by_joint) / 3
    assert (error < 0.05 * np.abs([by_joint, by_target])).all()


def test_smoothed_derivatives_become_the_exact_ones_by_the_second_order():
    sim = hs.Simulation("grasp_pinch", {"solver": "{engine: articulated}"})
    sim.step(substeps=2500)
    exact = sim.derivatives()
    errors = []
    for deviation in (2e-7, 1e-7):  # a contact that slides slowly sticks when it is turned by some 3e-6 rad
        smooth = sim.derivatives(smoothing=deviation)
        errors.append([np.abs(getattr(smooth, name) - getattr(exact, name)).max() for name in ("state", "targets", "gravity")])
    np.testing.assert_allclose(np.divide(*errors), 4, rtol=0.05)


def test_smoothed_gradients_of_a_run_find_a_contact_that_exact_ones_do_not_see(tip):
    """Targets by which the ball gets 50 mm/s in 40 ms, by Newton steps from a finger at rest above it."""
    start = tip.above(2e-4).motion()
    end = np.zeros(tip.size)
    end[tip.rate] = 1
    targets = np.zeros((40, len(tip.sim.scene.axes)))
    for turn in range(4):
        tip.sim.reset(start)
        run = hs.Rollout(tip.sim, targets, "targets", keep=True, smoothing=hs.Smoothing(DEVIATION, 16))
        if turn == 0:
            tip.sim.reset(start)
            assert not hs.Rollout(tip.sim, targets, "targets").vjp(end).action.any()
        targets[:, tip.target] += (-0.05 - run.states[-1, tip.rate]) / run.vjp(end).action[:, tip.target].sum()
    assert abs(run.states[-1, tip.rate] + 0.05) < 1e-3


def test_optimal_control_finds_that_contact_too(tip):
    costs = []
    for smoothing in (None, hs.Smoothing(DEVIATION, 8)):
        tip.above(2e-4)
        problem = optimise.Problem(tip.sim, "targets", [tip.target], knots=8, hold=5)
        problem.smoothing = smoothing
        problem.effort[:] = 1e-3
        row = np.zeros((1, tip.size))
        row[0, tip.rate] = 1
        end = np.zeros(9)
        end[-1] = 1
        problem.terms = [optimise.Term("push", end, lambda sim, k: (np.array([sim.bodies.velocity[-1, 2] + 0.05]), row))]
        costs.append(optimise.solve(problem, most=5).trajectory.cost)
    assert costs[0] == 0.05**2 and costs[1] < 0.01 * costs[0]


def test_a_simulation_stays_and_the_same_seed_gives_the_same_bits(tip):
    sim = tip.above(1e-4)
    before, time = sim.motion(), sim.time
    one, two = (sim.derivatives(smoothing=hs.Smoothing(DEVIATION, 8, seed=3)) for _ in range(2))
    assert (one.state == two.state).all() and sim.time == time
    sim.derivatives(smoothing=hs.Smoothing(DEVIATION, 8), advance=True)
    there, q = sim.time, sim.q.copy()
    sim.reset(before)
    sim.derivatives(advance=True)
    assert sim.time == there and (sim.q == q).all()


def test_states_that_no_step_is_made_of_are_left_out_and_counted(tip):
    sim = tip.above(1e-4)
    rates = np.zeros(tip.size)
    rates[tip.size // 2 + tip.joint] = 1e3
    found = sim.derivatives(smoothing=hs.Smoothing(rates, 16))
    assert "of 16 pairs are left out: " in found.notes[-1] and np.isfinite(found.state).all()
    before = sim.time
    with pytest.raises(hs.Error, match="state.right"):
        sim.derivatives(smoothing=hs.Smoothing(50 * rates, 16))
    sim.step()
    assert sim.time > before


def test_wrong_smoothing_says_what_is_needed(tip):
    sim = tip.above(1e-4)
    for wrong, need in ((-1e-4, "none negative"), (hs.Smoothing(np.ones(3)), r"shape \(\d+,\)"), ("much", "or a Smoothing"),
                        (hs.Smoothing(1e-4, 0), "smoothing.pairs: got 0"), (hs.Smoothing(1e-4, 8, -1), "seed: got -1")):
        with pytest.raises(hs.Error, match=need):
            sim.derivatives(smoothing=wrong)
    with pytest.raises(hs.Error, match="smoothing: got 'much'"):
        hs.Rollout(sim, np.zeros((1, len(sim.q))), smoothing="much")
