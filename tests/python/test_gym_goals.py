"""Tasks with goals of a few numbers, and those in which the wrist moves."""
import numpy as np
import pytest

import handsim as hs
from handsim.gym import TASKS, Bottle, Button, Episodes, MovingWrist, Relocate, Rotate
from handsim.gym._episodes import task_of

NAMES = "button", "rotate", "relocate", "bottle"
WRISTS = "relocate", "bottle"


def pressed(episodes, force, steps=100):
    """The index finger's first joint goes on until the button gives the force: success in each environment, and steps."""
    task, n = episodes.task, len(episodes.batch)
    flexion = task.scene.axes.index("right.index_mcp.flexion")
    won = np.zeros(n, bool)
    for _ in range(steps):
        action = np.zeros((n, task.actions))
        action[:, flexion] = np.clip(0.3 * (force - task.achieved(episodes.batch)[:, 0]), -0.5, 0.3)
        *_, terminated, _ = episodes.step(action)
        won |= task.succeeded(episodes.batch) & terminated
    return won


# Oracle: a scripted policy that reads the force alone.
def test_a_button_is_pressed_with_the_force_that_is_asked_for():
    episodes = Episodes("button", 16, seed=1)
    assert pressed(episodes, episodes.task._goal[:, 0]).all()


# Oracle: the spring: its force over the way that the button has moved is the stiffness of each episode, and what a finger adds
# to its travel at rest.
def test_a_button_is_a_spring_of_each_episodes_own():
    episodes = Episodes("button", 32, seed=1)
    task = episodes.task
    least, largest = task.springs
    assert task._stiffness.min() >= least and task._stiffness.max() <= largest and np.ptp(task._stiffness) > 0.7 * (largest - least)
    push = np.zeros((32, 21))
    for _ in range(300):
        push[:, -1] = 2 - task._stiffness * episodes.batch.q[:, -1] - task.damping * episodes.batch.u[:, -1]
        episodes.batch.step(torques=push, targets=np.tile(episodes.batch.q[:, :20], 1))
    assert task.achieved(episodes.batch)[:, 0] == pytest.approx(2 + 0 * task._stiffness, abs=0.25)  # and its own weight of 0.2 N


# Oracles: the window, which ends on both sides; a force far beyond it, which ends the episode with less reward.
def test_a_button_that_is_pressed_too_hard_is_lost():
    episodes = Episodes("button", 8, seed=2)
    task = episodes.task
    wrong = np.where(task._goal[:, 0] > 2.75, -1, 1)
    assert not pressed(episodes, task._goal[:, 0] + 2 * task.near * wrong).any()
    episodes.reset(seed=2)
    flexion = task.scene.axes.index("right.index_mcp.flexion")
    lost = np.zeros(8, bool)
    for _ in range(60):
        action = np.zeros((8, 20))
        action[:, flexion] = 1
        _, reward, terminated, _ = episodes.step(action)
        assert np.all(reward[terminated & ~lost] < -9)
        lost |= terminated
    assert lost.all() and not task.succeeded(episodes.batch).any()


# Oracle: a turn of the test's own: a cube turned by its goal's angle about the vertical is at its goal, tilted or not.
def test_rotating_counts_the_turn_about_the_vertical_alone():
    episodes = Episodes("rotate", 64, seed=1)
    task, first = episodes.task, episodes.batch["objects"][:, 3:7].copy()
    angle = np.arctan2(task._goal[:, 1], task._goal[:, 0])
    assert np.abs(angle).min() > 0.5 and np.abs(angle).max() < 1.5 and angle.min() < 0 < angle.max()
    assert task.missing(episodes.batch)[:, 0] == pytest.approx(angle)
    half = angle / 2
    w, x, y, z = first.T
    turned = np.column_stack([np.cos(half) * w - np.sin(half) * z, np.cos(half) * x - np.sin(half) * y,
                              np.cos(half) * y + np.sin(half) * x, np.cos(half) * z + np.sin(half) * w])
    batch = {"objects": np.hstack([episodes.batch["objects"][:, :3], turned, np.zeros((64, 6))])}
    assert np.abs(task.missing(batch)).max() < 1e-12
    assert task.scene.coordinates[0].startswith("right.wrist") and task.actions == 22
    ball = Episodes(Rotate(object="tennis_ball"), 2)
    for _ in range(10):
        *_, terminated, _ = ball.step(np.zeros((2, 22)))
    assert ball.task.scene.objects == ["tennis_ball"] and not terminated.any()


def carried(episodes, until=150):
    """Reach, grasp, lift, and hold at the goal, by the ball's place alone. Success, and whether the ball left the ground before."""
    task, n = episodes.task, len(episodes.batch)
    won, lifted = np.zeros(n, bool), np.zeros(n, bool)
    for step in range(until):
        action, ball = np.zeros((n, task.actions)), task.achieved(episodes.batch)
        if step < 40:
            want, fingers = ball, -1.0
        elif step < 75:
            want, fingers = task.grip(episodes.batch), -1 + 2 * (step - 40) / 30
        else:
            far = task._goal - ball
            want = task.grip(episodes.batch) + far * np.minimum(1, 0.02 / np.linalg.norm(far, axis=1, keepdims=True))
            fingers = 1.0
        action[:, :3] = np.clip((want - task._place) / (task.speed_of_place * 0.02), -0.5, 0.5)
        action[:, 4:] = min(1.0, fingers)
        *_, terminated, _ = episodes.step(action)
        lifted |= task.held(episodes.batch) & (task.height(episodes.batch) > 0.015)
        won |= terminated & task.succeeded(episodes.batch) & lifted
    return won


# Oracle: a scripted policy.
def test_a_ball_is_reached_grasped_lifted_and_held_at_its_place():
    assert carried(Episodes("relocate", 16, seed=1)).all()


def put_down(episodes):
    """Reach, grasp, carry, put down and let go, by the ball's place alone. Success in each environment, and whether it came while the
    fingers still closed."""
    task, n = episodes.task, len(episodes.batch)
    won, closed, low, opening = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, bool), np.zeros(n)
    for step in range(task.max_steps):
        action, ball, grip = np.zeros((n, task.actions)), task.achieved(episodes.batch), task.grip(episodes.batch)
        if step < 25:
            want, fingers = ball, -np.ones(n)
        elif step < 55:
            want, fingers = grip, np.full(n, min(1.0, -1 + (step - 25) / 12))
        else:
            far, height = task._goal - ball, task.height(episodes.batch)
            low |= (np.linalg.norm(far[:, :2], axis=1) < 0.01) & (height > 0.02)
            far[:, 2] = np.where(low, -height - 0.005, 0.03 - height)
            opening = np.where((low & (height < 0.003)) | (opening > 0), opening + 1, 0)
            far = np.where(opening[:, np.newaxis] > 0, np.where(opening[:, np.newaxis] > 25, [0, 0, 0.02], 0.0), far)
            want = grip + far * np.minimum(1, 0.02 / np.maximum(np.linalg.norm(far, axis=1, keepdims=True), 1e-9))
            fingers = np.clip(1 - opening / 10, -1, 1)
        action[:, :3] = np.clip((want - task._place) / (task.speed_of_place * 0.02), -0.8, 0.8)
        action[:, 4:] = fingers[:, np.newaxis]
        *_, terminated, _ = episodes.step(action)
        now = terminated & task.succeeded(episodes.batch)
        won, closed = won | now, closed | (now & (opening == 0))
    return won, closed


# Oracle: a scripted policy.
def test_a_ball_is_put_down_and_let_go():
    won, closed = put_down(Episodes(Relocate(put_down=True), 16, seed=1))
    assert won.all() and not closed.any()


# Oracle: what put down means: a ball that lies at its place, and that nothing touches, was never lifted.
def test_a_ball_that_was_not_lifted_is_not_put_down():
    episodes = Episodes(Relocate(put_down=True), 8, seed=1)
    task, ball = episodes.task, episodes.batch["objects"][:, :3]
    apart = np.linalg.norm(task._goal - ball, axis=1)
    assert apart.min() >= 0.08 and apart.max() <= 0.15 and np.ptp(apart) > 0.03 and task._goal[:, 2] == pytest.approx(task.radius)
    task._goal = ball.copy()
    action = np.zeros((8, task.actions))
    action[:, 4:] = -1
    for _ in range(10):
        *_, terminated, _ = episodes.step(action)
        assert not terminated.any() and np.all(task.distance(episodes.batch) < 1e-3)


# Oracle: the definition: one number moves all joints as twenty equal ones do, but for those that are alike in both poses.
@pytest.mark.parametrize("name", WRISTS)
def test_a_synergy_is_all_joints_at_once(name):
    one, all_joints = Episodes(TASKS[name](synergy=True), 2, seed=1), Episodes(name, 2, seed=1)
    assert one.task.actions == 5 and all_joints.task.actions == 24
    same = one.task._half == all_joints.task._half
    assert same.sum() >= 15 and np.all(one.task._half[~same] == 0)
    for k in range(10):
        few = np.full((2, 5), 0.1 * k)
        one.step(few)
        all_joints.step(np.hstack([few[:, :4], np.where(same, few[:, 4:], 0)]))
    assert np.array_equal(one.batch.q, all_joints.batch.q)


# Oracle: the reward as it is defined: a hand that waits gains and loses nothing but its effort, so that no loss is ahead of waiting.
@pytest.mark.parametrize("name", NAMES)
def test_waiting_costs_nothing(name):
    episodes = Episodes(name, 4, seed=1)
    action = np.zeros((4, episodes.task.actions))
    if name in WRISTS:
        action[:, 4:] = -1
    total = np.zeros(4)
    for step in range(60):
        _, reward, terminated, _ = episodes.step(action)
        total += (step >= 20) * (reward - episodes.task.rewarded["effort"])
        assert not terminated.any()
    assert np.abs(total).max() < 0.5


# Oracle: the sum of the terms' gains is what the last state is worth more than the first.
def test_gains_add_up_to_the_worth():
    episodes = Episodes("relocate", 4, seed=1)
    task, random, total = episodes.task, np.random.default_rng(0), np.zeros(4)
    for step in range(30):
        episodes.step(random.uniform(-1, 1, (4, 24)))
        if step == 0:
            first = sum(task.worth(episodes.batch).values())
        total += sum(task.rewarded[name] for name in task.worth(episodes.batch))
    assert total == pytest.approx(sum(task.worth(episodes.batch).values()) - first) and np.abs(total).min() > 0.1


# Oracle: gravity: without fingers on it, the ball stays on the ground whatever the wrist does.
def test_a_ball_that_is_not_grasped_stays_on_the_ground():
    episodes = Episodes("relocate", 4, seed=1)
    action = np.zeros((4, 24))
    for step in range(80):
        action[:, :3], action[:, 4:] = (0, 0, -0.5 if step < 30 else 0.5), -1
        episodes.step(action)
    assert np.abs(episodes.task.height(episodes.batch)).max() < 1e-3 and not episodes.task.held(episodes.batch).any()


# Oracle: a scripted policy: fingers around the cap, and a wrist that turns.
def test_a_cap_is_unscrewed_to_its_angle():
    episodes = Episodes("bottle", 16, seed=1)
    task, won = episodes.task, np.zeros(16, bool)
    for step in range(task.max_steps):
        action, cap = np.zeros((16, task.actions)), np.array([0, 0, task.height + 0.006])
        action[:, :3] = np.clip((cap - task._place) / (task.speed_of_place * 0.02), -0.5, 0.5)
        action[:, 4:] = -1 if step < 20 else min(1, -1 + 2 * (step - 20) / 25)
        if step >= 50:
            action[:, 3] = np.clip(2 * (task._goal - task.achieved(episodes.batch))[:, 0], -1, 1)
        *_, terminated, _ = episodes.step(action)
        won |= terminated & task.succeeded(episodes.batch)
    assert won.all()


# Oracle: the drag of each episode: a torque of the test's own turns a free cap at the rate at which drag and torque are equal.
def test_a_cap_turns_against_its_drag():
    episodes = Episodes(Bottle(drive="torques"), 16, seed=1)
    task = episodes.task
    assert task._drag.min() >= 0.05 and task._drag.max() <= 0.15
    for _ in range(200):
        torques = task.acts(episodes.batch, {"torques": np.eye(21)[20] * 0.02})["torques"]
        torques[:, -1] += 0.02
        episodes.batch.step(torques)
    assert episodes.batch.u[:, -1] == pytest.approx(2 * 0.02 / task._drag, rel=1e-3)


def watched(episodes, actions):
    """Makes steps. Of each step of the solver: the arm's force and moment [N], [N m], the hand's speed [m/s], and the arm's power [W],
    each of shape (steps, n), from what the batch itself was given."""
    task, batch, rows = episodes.task, episodes.batch, []
    step, (palm, centre) = batch.step, np.split(task._carried[0, :6], 2)

    def one(*args, forces, **given):
        force, moment = np.split(forces["right.palm"], 2, axis=1)
        speed = task._speed(batch)
        moment = moment - np.cross(task._lever(batch, centre) - task._lever(batch, palm), force)
        rows.append([np.linalg.norm(force, axis=1), np.linalg.norm(moment, axis=1), np.linalg.norm(speed, axis=1), np.sum(force * speed, axis=1)])
        step(*args, forces=forces, **given)

    batch.step = one
    for action in actions:
        episodes.step(action)
    return np.array(rows).transpose(1, 0, 2)


# Oracle: the limits, under the largest actions, which change at random, against ground, ball and cap, with fingers that fling.
@pytest.mark.parametrize("name", WRISTS)
@pytest.mark.parametrize("drive", ("targets", "torques", "muscles"))
def test_the_wrist_keeps_its_limits(name, drive):
    episodes = Episodes(TASKS[name](drive=drive), 16, seed=1)
    random = np.random.default_rng(0)
    actions = np.repeat(random.choice([-1.0, 1.0], (10, 16, episodes.task.actions)), 6, axis=0)
    actions[:, :8, 2] = -1  # half of them press down
    force, moment, speed, power = watched(episodes, actions)
    assert not episodes.batch.failed.any() and force.max() > 6 and speed.max() > 0.2
    assert force.max() <= 30 * (1 + 1e-9) and moment.max() <= 4 * (1 + 1e-9) and power[speed > 0.5].max(initial=0) < 1e-9


# Oracle: the limit of speed: an arm alone, with fingers that stay in their pose, never takes the hand there.
def test_the_arm_moves_the_hand_slower_than_its_limit():
    episodes = Episodes("relocate", 16, seed=1)
    actions = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], (20, 16, 24)), 4, axis=0)
    actions[:, :, 2], actions[:, :, 4:] = np.abs(actions[:, :, 2]), -1
    _, _, speed, _ = watched(episodes, actions)
    assert 0.35 < speed.max() < 0.5


# Oracle: work: what the arm gives over a slow rise is what the hand has won in height.
def test_the_arm_gives_the_work_of_the_lift():
    episodes = Episodes("relocate", 1, seed=1)
    task, batch = episodes.task, episodes.batch
    work, action = 0.0, np.zeros((1, task.actions))
    action[:, 4:] = -1
    step = batch.step

    def measured(*args, forces, **given):
        nonlocal work
        before = task._speed(batch).copy()
        step(*args, forces=forces, **given)
        work += float(np.sum(forces["right.palm"][0, :3] * 0.5 * (before + task._speed(batch))[0])) * task.scene.step

    for _ in range(20):
        episodes.step(action)
    start = task.grip(batch)[0, 2]
    batch.step = measured
    action[:, 2] = 0.25
    for _ in range(60):
        episodes.step(action)
    action[:, 2] = 0
    for _ in range(20):
        episodes.step(action)
    height = task.grip(batch)[0, 2] - start
    assert height > 0.1 and work == pytest.approx(task._carried[0, 6] * 9.80665 * height, rel=0.01)


# Oracle: each person's own hand is carried: it stays where it is when nothing is asked of it.
def test_the_arm_carries_each_persons_hand():
    episodes = Episodes(Relocate(persons=4), 16, seed=1)
    task = episodes.task
    assert set(task.person) == {0, 1, 2, 3} and len(set(task._carried[:, 6])) == 4
    action = np.zeros((16, task.actions))
    action[:, 4:] = -1
    for _ in range(40):
        episodes.step(action)
    assert np.abs(task.grip(episodes.batch) - task._home).max() < 2e-3 and not episodes.batch.failed.any()


# Oracle: the file that the poses are of.
def test_the_poses_are_those_of_the_grasp():
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: poses of the wrist's tasks are not compared with their file")
    known = yaml.safe_load((hs._shipped.data_path() / "controllers/grasp_poses.yaml").read_text())["poses"]
    for mine, name in ((MovingWrist.opened, "open_sphere_70mm"), (MovingWrist.closed, "sphere_70mm")):
        assert {joint: list(angle) for joint, angle in mine.items()} == {joint: np.ravel(angle).tolist() for joint, angle in known[name].items()}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("drive", ("targets", "torques", "muscles"))
def test_every_drive_and_seed(name, drive):
    first, second = (Episodes(TASKS[name](drive=drive), n, seed=seed, threads=n % 2) for n, seed in ((3, 4), (2, 9)))
    second.reset(seed=4)
    random = np.random.default_rng(1)
    for _ in range(8):
        action = random.uniform(-1, 1, (3, first.task.actions))
        a, b = first.step(action), second.step(action[:2])
        assert all(np.array_equal(x[:2], y) for x, y in zip(a, b))
    assert np.isfinite(a[0]).all() and not first.batch.failed.any()


@pytest.mark.parametrize("name, options, said", [
    ("relocate", {"synergy": 1}, "synergy: got 1, need True or False"), ("bottle", {"synergy": True, "drive": "muscles"}, "synergy: got True beside drive muscles"),
    ("button", {"synergy": True}, "synergy: got True, need options of button"), ("relocate", {"put_down": "yes"}, "put_down: got 'yes', need True or False"),
    ("relocate", {"put_down": True, "goals": True}, "put_down: got True beside goals")])
def test_wrong_options_of_one_task_are_refused_with_their_names(name, options, said):
    with pytest.raises(hs.Error, match=said):
        task_of(name, **options)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("options, said", [
    ({"drive": "wires"}, "drive: got wires, need one of targets, torques, muscles"), ({"goals": 1}, "goals: got 1, need True or False"),
    ({"variants": 0, "vary": {"hands.0.tissue.damping": {"choice": [1]}}}, "variants: got 0, need a whole number, 1 to 1024"),
    ({"vary": {"hands.0.tissue.dumping": {"choice": [1]}}}, "hands.0.tissue.dumping"), ({"arm": 3}, "arm: got 3, need options of")])
def test_wrong_options_are_refused_with_their_names(name, options, said):
    with pytest.raises(hs.Error, match=said):
        task_of(name, **options)


# Oracles: the reward of a step is that of its goals, and moves with a goal that is put where the hand has come; draws are kept.
@pytest.mark.parametrize("name", NAMES)
def test_goals_stand_by_themselves_in_every_such_task(name):
    episodes = Episodes(TASKS[name](goals=True), 4, seed=1)
    task, k = episodes.task, episodes.task.goal_numbers
    plain = Episodes(name, 4, seed=1)
    for _ in range(5):
        action = np.full((4, task.actions), 0.1)
        observation, reward, terminated, _ = episodes.step(action)
        plain.step(action)
    achieved, goal = observation[:, -2 * k:-k], observation[:, -k:]
    assert np.array_equal(task.goal_reward(achieved, goal), reward) and not terminated.any() and np.all(task.goal_reward(achieved, achieved) == 0)
    assert np.array_equal(goal, plain.task._goal) and np.array_equal(achieved, plain.task.achieved(plain.batch))
    # What is observed beside the goals does not know them.
    task._goal = task._goal + 1
    assert np.array_equal(task.observation(episodes.batch)[:, :-k], observation[:, :-k])


def test_hindsight_experience_replay_takes_the_new_goals():
    sb3 = pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed: its replay of goals is not tested")
    __import__("torch").set_num_threads(1)
    for name in NAMES:
        model = sb3.SAC("MultiInputPolicy", hs.gym.sb3_vec(name, 2, goals=True, max_episode_steps=8), replay_buffer_class=sb3.HerReplayBuffer,
                        learning_starts=20, batch_size=8, policy_kwargs={"net_arch": [8]}, device="cpu")
        model.learn(40)
        assert model.replay_buffer.sample(64).rewards.max() == 0 and model.num_timesteps == 40


def test_draws_of_the_scene_reach_the_new_tasks():
    task = TASKS["relocate"](vary={"objects.0.mass": {"uniform": ["100 g", "300 g"]}, "hands.0.tissue.damping": {"choice": [1, 2]}}, variants=3)
    episodes = Episodes(task, 8, seed=1)
    mass = episodes.batch.get("objects.0.mass")[:, 0]
    assert mass.min() > 0.1 and mass.max() < 0.3 and len(set(mass)) == 8 and len(task.people) == 3
    button = Episodes(Button(vary={"hands.0.tissue.damping": {"choice": [1, 2]}}, variants=2), 8, seed=1)
    assert set(button.task.person) == {0, 1} and pressed(button, button.task._goal[:, 0]).all()


# Oracle: a simulation's own taxels at the same motion, and the normal forces of its contacts.
@pytest.mark.parametrize("name", ("hold", "turn", "reorient", "pen_twirl", "rotate", "key_turn", "button", "relocate", "bottle"))
def test_taxels_are_observed_by_a_flag(name):
    task = TASKS[name](taxels=True)
    episodes, plain = Episodes(task, 2, seed=1), Episodes(name, 2, seed=1)
    for k in range(25):
        action = np.full((2, task.actions), 0.6)
        if name == "button":  # the index finger alone, until it presses
            action[:] = 0
            action[:, task.scene.axes.index("right.index_mcp.flexion")] = 0.3 if (task.achieved(episodes.batch) < 1).any() else 0
        episodes.step(action)
        plain.step(action)
    taxels = episodes.batch["taxels"]
    assert task.observation(episodes.batch).shape[1] == plain.task.observation(plain.batch).shape[1] + taxels.shape[1]
    one = hs.Simulation(task.scene)
    one.reset(episodes.batch.motion(1))
    one.step()
    alone = hs.Batch(task.scene, 1, observe=["taxels"])
    alone.reset(to=episodes.batch.motion(1))
    alone.step()
    touch = one.taxels(5e-3)
    assert np.array_equal(alone["taxels"][0], touch.forces) and taxels.shape == (2, sum(touch.counts))
    assert [column.split(".taxel")[0] for column in alone.columns_of("taxels")] == [pad for pad, count in zip(touch.pads, touch.counts) for _ in range(count)]
    assert np.array_equal(plain.batch.q, episodes.batch.q)
    if name not in ("pen_twirl", "relocate", "bottle"):  # a pen lies between sides of fingers; what the wrist goes to is not reached so soon
        assert (taxels > 0).any()
