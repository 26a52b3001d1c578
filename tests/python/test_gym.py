"""Environments for learning."""
import json
import multiprocessing
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import handsim as hs
from handsim.gym import TASKS, Episodes, KeyTurn, Pose, Reach, SceneTask

needs_gymnasium = pytest.mark.skipif(
    __import__("importlib.util").util.find_spec("gymnasium") is None,
    reason="gymnasium is not installed (pip install gymnasium): its environments are not tested")
DRIVES = ("targets", "torques", "muscles")


# Oracle: the same seed and actions give the same bits, in any number of threads.
@pytest.mark.parametrize("name", TASKS)
def test_episodes_are_a_function_of_the_seed(name):
    first, second = Episodes(name, 4, seed=5, threads=1), Episodes(name, 4, seed=6, threads=2)
    actions = np.random.default_rng(1).uniform(-1, 1, (5, 4, first.task.actions))
    histories = []
    for each in (first, second):
        each.reset(seed=7)
        histories.append([np.hstack([np.column_stack(each.step(action)[1:]), each.batch.observation]) for action in actions])
    assert np.array_equal(*histories)
    other = Episodes(name, 4, seed=8)
    if name not in ("hold", "turn", "key_turn"):  # what these draw is not observed at the start
        assert not np.array_equal(other.task.observation(other.batch), first.reset(seed=7))


# Oracle: a policy that goes straight to the goal reaches it: every episode ends with the reward of success.
def test_pose_is_solved_by_going_to_the_goal():
    episodes = Episodes("pose", 8)
    task = episodes.task
    k = task.actions
    observation = episodes.reset(seed=1)
    reached = np.zeros(8, bool)
    for _ in range(task.max_steps):
        observation, reward, terminated, _ = episodes.step((observation[:, -k:] - observation[:, -2 * k:-k]) / Pose.speed)
        assert np.all(reward[terminated & ~reached] > 9)
        reached |= terminated
    assert reached.all()


# Oracle: goals come from postures that the drive holds, so that the action which made one leads to it.
@pytest.mark.parametrize("name", ("pose", "reach"))
def test_muscles_reach_their_goals_by_the_excitations_that_made_them(name):
    episodes = Episodes(TASKS[name](drive="muscles"), 64)
    task, random = episodes.task, np.random.default_rng(0)
    made = 0.4 * random.random((512, task.actions)) * (random.random((512, task.actions)) < 0.3)
    episodes.reset(seed=3)
    chosen = [int(np.argmin(np.abs(task._goals[0] - goal).sum(axis=1))) for goal in task._goal]
    action = 2 * np.cbrt(made[chosen]) - 1
    success = np.zeros(64, bool)
    for _ in range(task.max_steps):
        _, reward, terminated, _ = episodes.step(action)
        success |= terminated
    assert success.all()


# Oracles: the action's own scale; more excitation, more activation.
@pytest.mark.parametrize("drive", DRIVES)
def test_drives_do_what_they_say(drive):
    task = Pose(drive=drive)
    episodes = Episodes(task, 2)
    low, high = (episodes.step(np.full((2, task.actions), sign))[0].copy() for sign in (-1.0, 1.0))
    assert low.shape == high.shape and np.isfinite(high).all()
    if drive == "muscles":
        assert task.actions == 41 and np.all(high[:, 40:81] > low[:, 40:81]) and high[:, 40:81].max() <= 1
    else:
        assert task.actions == 20 and np.all(high[:, 20:40].sum(axis=1) > low[:, 20:40].sum(axis=1))
    with pytest.raises(hs.Error, match="drive: got wires, need one of targets, torques, muscles"):
        Pose(drive="wires")


# Oracle: every episode has one of the drawn persons, and its goal is one that this person's hand reaches.
def test_each_episode_has_another_person():
    task = Reach(drive="muscles", persons=4)
    episodes = Episodes(task, 64)
    before = task.person.copy()
    episodes.reset(seed=1)
    assert set(before) == set(task.person) == {0, 1, 2, 3} and not np.array_equal(before, task.person)
    for i in range(64):
        assert episodes.batch.scene_of(i) is task.people[task.person[i]]
        assert np.any(np.all(task._goals[task.person[i]] == task._goal[i], axis=1))
    lengths = [hs.Hand(**person).dimensions["length"] for person in hs.draw_persons(4)]
    tips = [np.linalg.norm(episodes.batch["fingertips"][list(task.person).index(k), 14:17] - [0, 0, 0.2]) for k in range(4)]
    assert np.argsort(tips).tolist() == np.argsort(lengths).tolist()


# Oracle: the mirror image: the same action moves both hands alike.
def test_two_hands_take_their_poses():
    episodes = Episodes(Pose(hands=2), 2)
    assert episodes.task.actions == 40 and episodes.task.scene.hands == ["right", "left"]
    half = np.random.default_rng(0).uniform(-1, 1, (2, 20))
    episodes.step(np.hstack([half, half]))
    assert np.allclose(episodes.batch.q[:, :20], episodes.batch.q[:, 20:], atol=1e-12)
    with pytest.raises(hs.Error, match="hands: got True, need 1 or 2"):
        Pose(hands=True)
    with pytest.raises(hs.Error, match="hands: got 3, need 1 or 2"):
        Pose(hands=3)


# Oracle: a motion begins with the object where the settled hand holds it, whatever the drive.
@pytest.mark.parametrize("name", ("hold", "turn", "reorient", "pen_twirl"))
def test_objects_begin_in_the_hand_by_every_drive(name):
    starts = []
    for drive in DRIVES:
        episodes = Episodes(TASKS[name](drive=drive), 2)
        assert episodes.task.actions == (41 if drive == "muscles" else 20)
        starts.append(np.hstack([episodes.batch.q[0], episodes.batch["objects"][0, :7]]))
    assert np.allclose(starts[0], starts[1], atol=1e-9) and np.array_equal(starts[1], starts[2])


def _turned_by(torque, steps=100, of=KeyTurn):
    """A key that a torque of the test's own turns, between fingers that do not touch it."""
    episodes = Episodes(of(drive="torques"), 4)
    torques = np.zeros((4, len(episodes.task.scene.coordinates)))
    torques[:, -1] = torque
    episodes.batch.step(torques, substeps=steps)
    return episodes


# Oracles: the lock's spring brings the key back to its stop; the angle of a key that is not held counts 0.3.
def test_a_key_turns_against_its_spring():
    episodes = _turned_by(0.2, 20)
    task, batch, zero = episodes.task, episodes.batch, np.zeros((4, 20))
    turned = batch.q[:, -1].copy()
    assert np.all(turned > 0.1) and not task.held(batch).any()
    assert task.reward(batch, zero) + 0.5 * task._distances(batch).mean(axis=1) == pytest.approx(3 * turned)
    batch.step(substeps=500)
    assert np.abs(batch.q[:, -1]).max() < 0.01


# Oracle: a key that turns by itself, between fingers that do not hold it, is no success.
def test_a_key_that_is_not_held_does_not_count():
    episodes = _turned_by(0.2)
    for _ in range(10):
        episodes.batch.step(np.tile([*[0] * 20, 0.2], (4, 1)), substeps=10)
        episodes.task.reward(episodes.batch, np.zeros((4, 20)))
    assert np.all(episodes.batch.q[:, -1] > episodes.task.turned) and not episodes.task.terminated(episodes.batch).any()


# Oracle: the spring that each episode draws is the torque that holds the key in its place.
def test_each_key_has_a_spring_of_its_own():
    task = Episodes(KeyTurn(), 256).task
    torques = task.spring[0] - task._back[:, -1]
    assert torques.min() >= 0.02 and torques.max() <= 0.06 and np.ptp(torques) > 0.035
    for share, stays in ((0.95, True), (1.05, False)):
        episodes = Episodes(KeyTurn(drive="torques"), 16)
        push = -share * (episodes.task._back - np.eye(21)[20] * task.spring[0])
        episodes.batch.step(episodes.task._back + push, substeps=100)
        assert np.all((episodes.batch.q[:, -1] < 0.01) == stays)


# Oracle: feasibility: thumb and index turn the key by three postures of theirs, whatever its spring.
def test_a_key_is_turned_by_three_postures():
    postures = [[-0.08, 0.15, 0.64, 0.51, 1.15, 0.06, 0.91, 0.93], [0.0, 0.06, 0.62, 0.57, 1.31, 0.07, 0.9, 1.0],
                [0.26, -0.1, 0.51, 0.31, 1.08, 0.02, 1.08, 0.52]]
    episodes = Episodes("key_turn", 64)
    task = episodes.task
    assert [name.split("_")[0] for name in task.scene.axes[:8]] == ["right.thumb"] * 4 + ["right.index"] * 4
    episodes.reset(seed=7)
    want = episodes.batch.q[:, :20].copy()
    success = np.zeros(64, bool)
    for step in range(60):
        want[:, :8] = postures[(step >= 8) + (step >= 20)]
        _, reward, terminated, _ = episodes.step((want - task._targets) / task.speed)
        assert np.all(reward[terminated & ~success] > 10)
        success |= terminated & ~episodes.batch.failed
    assert success.all()


# Oracle: gravity: an opened hand drops the can within a second; one that squeezes holds it for the whole episode.
def test_hold_is_lost_by_doing_nothing_and_kept_by_squeezing():
    episodes = Episodes("hold", 8)
    flexion = np.array([name.endswith("flexion") for name in episodes.task.scene.axes], float)
    ended = {}
    for name, action in (("nothing", 0 * flexion), ("squeeze", 0.6 * flexion)):
        episodes.reset(seed=1)
        dropped = np.zeros(8, bool)
        for step in range(episodes.task.max_steps):
            *_, terminated, truncated = episodes.step(np.tile(action, (8, 1)))
            dropped |= terminated
        ended[name] = dropped
        assert np.array_equal(truncated, ~terminated)
    assert ended["nothing"].all() and not ended["squeeze"].any()


# Oracle: a ball at rest does not turn; the reward of a turning one is its angular velocity times the time of a step.
def test_turn_rewards_the_angle_that_the_ball_turns():
    episodes = Episodes("turn", 4)
    zero = np.zeros((4, episodes.task.actions))
    for _ in range(10):
        _, reward, terminated, _ = episodes.step(zero)
    assert not terminated.any() and np.abs(reward).max() < 1e-4
    for _ in range(5):
        episodes.batch.step(targets=np.tile(episodes.task._middle, (4, 1)),
                            forces={"ball": np.tile([0, 0, 0, 0, 0, 5e-3], (4, 1))}, substeps=2)
    spin = episodes.batch["objects"][:, 12]
    assert np.all(spin > 0.02)
    assert episodes.task.reward(episodes.batch, zero) == pytest.approx(spin * 0.02)


# Oracles: an object that lies still keeps its distance from the goal; one that is turned by the missing rotation has none.
@pytest.mark.parametrize("name", ("reorient", "pen_twirl"))
def test_an_object_is_at_its_goal_when_it_is_turned_by_what_is_missing(name):
    episodes = Episodes(name, 16)
    task, zero = episodes.task, np.zeros((16, 20))
    episodes.reset(seed=2)
    missing = task.missing(episodes.batch)
    angle = np.linalg.norm(missing, axis=1)
    assert np.all(angle > 0.29) and np.all(angle < 1.01)
    for _ in range(10):
        observation, reward, terminated, _ = episodes.step(zero)
    assert np.allclose(observation[:, -3:], missing, atol=1e-3) and not terminated.any()
    assert np.allclose(reward, -angle, atol=1e-3)
    first = episodes.batch["objects"][:, 3:7].copy()
    half = np.linalg.norm(observation[:, -3:], axis=1, keepdims=True) / 2
    turn = np.hstack([np.cos(half), np.sin(half) * observation[:, -3:] / (2 * half)])
    w, v, x, u = turn[:, :1], turn[:, 1:], first[:, :1], first[:, 1:]
    turned = np.hstack([w * x - (v * u).sum(axis=1, keepdims=True), w * u + x * v + np.cross(v, u)])
    batch = {"objects": np.hstack([episodes.batch["objects"][:, :3], turned, np.zeros((16, 6))])}
    assert np.abs(task.missing(batch)).max() < 1e-6


# Oracle: the reward function itself.
def test_any_scene_becomes_a_task(two_hands):
    task = SceneTask(two_hands, lambda batch: batch.q.sum(axis=1), terminated=lambda batch: batch.q[:, 0] > 10,
                     max_steps=3)
    episodes = Episodes(task, 2)
    for step in range(3):
        observation, reward, terminated, truncated = episodes.step(np.ones((2, 40)))
    assert np.array_equal(reward, observation[:, :40].sum(axis=1))
    assert not terminated.any() and truncated.all()
    with pytest.raises(hs.Error, match="task: got jump, need one of pose, reach, hold, turn, reorient, pen_twirl, key_turn, button, rotate, relocate, bottle"):
        Episodes("jump", 2)


@needs_gymnasium
@pytest.mark.parametrize("name", TASKS)
def test_gymnasiums_own_check_passes(name):
    import gymnasium
    from gymnasium.utils.env_checker import check_env

    render_mode = "rgb_array" if hs.has_pictures else None
    env = gymnasium.make(f"handsim/{name.title().replace('_', '')}-v0", render_mode=render_mode)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*precision lowered.*")
        check_env(env.unwrapped, skip_render_check=not hs.has_pictures)
    env.close()


# Oracle: gymnasium's own vector of single environments: the same bits, the same infos with their masks, the same resets, and a
# limit of steps that gymnasium's TimeLimit counts alone.
@needs_gymnasium
@pytest.mark.parametrize("name", ["Reach", "Hold", "Reorient"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_vectors_are_gymnasiums_vectors_of_single_environments(name, mode):
    import gymnasium
    from gymnasium.vector import AutoresetMode, VectorEnv

    ours = gymnasium.make_vec(f"handsim/{name}-v0", 3, max_episode_steps=30, autoreset_mode=mode, threads=1)
    theirs = gymnasium.make_vec(f"handsim/{name}-v0", 3, max_episode_steps=30, vectorization_mode="sync",
                                vector_kwargs={"autoreset_mode": AutoresetMode(mode)})
    assert isinstance(ours.unwrapped, VectorEnv) and ours.episodes.task.max_steps == 30
    assert ours.metadata["autoreset_mode"] is AutoresetMode(mode)
    assert np.array_equal(ours.reset(seed=4)[0], theirs.reset(seed=4)[0])
    random, ended = np.random.default_rng(0), np.zeros(3, int)
    for _ in range(70):
        action = random.uniform(-1, 1, (3, 20)).astype(np.float32)
        (*mine, info), (*others, other) = ours.step(action), theirs.step(action)
        for a, b in zip(mine, others):
            assert np.array_equal(a, b)
        ended += mine[2] | mine[3]
        same_info(info, other)
    assert ended.min() >= 2


def same_info(info, other):
    assert set(info) == set(other)
    for key, value in info.items():
        if isinstance(value, dict):
            same_info(value, other[key])
        elif key == "final_obs":
            assert all(a is b is None or np.array_equal(a, b) for a, b in zip(value, other[key]))
        else:
            assert value.dtype == other[key].dtype and np.array_equal(value, other[key]), key


# Oracle: a seed of its own makes an environment, whatever the others have; None goes on.
@needs_gymnasium
def test_seeds_are_each_environments_own():
    env = hs.gym.make_vec("reach", 3)
    first = env.reset(seed=[5, 6, 5])[0]
    assert np.array_equal(first[0], first[2]) and not np.array_equal(first[0], first[1])
    assert np.array_equal(env.reset(seed=5)[0][:2], first[:2])
    kept = env.reset(seed=[None, 6, None])[0]
    assert np.array_equal(kept[1], first[1]) and not np.array_equal(kept[0], first[0])
    for wrong, said in (([1, 2], "seed: got 2 seeds, need a seed for each of 3"), (-1, "seed: got -1"), (["a", 1, 2], "seed: got 'a'")):
        with pytest.raises(hs.Error, match=said):
            env.reset(seed=wrong)


# Oracle: a run without resets: what SAME_STEP gives as the last observation of an episode is what DISABLED shows.
@needs_gymnasium
def test_the_last_observation_is_that_of_a_run_without_resets():
    same, disabled = (hs.gym.make_vec("hold", 3, autoreset_mode=mode) for mode in ("SameStep", "Disabled"))
    first = same.reset(seed=1)[0].copy()
    disabled.reset(seed=1)
    for _ in range(100):
        # Environment 0 opens its hand, the others squeeze.
        action = np.full((3, 20), 0.6, np.float32) * [[0], [1], [1]]
        observation, _, terminated, _, info = same.step(action)
        last, _, also, _, all_info = disabled.step(action)
        assert np.array_equal(terminated, also)
        if terminated[0]:
            break
    assert info["_final_obs"].tolist() == [True, False, False] and np.array_equal(info["final_obs"][0], last[0])
    assert np.linalg.norm(info["final_obs"][0][-13:-10]) > 0.05 and observation[0] == pytest.approx(first[0], abs=1e-6)
    # The dropped can is no success, and said so once, in the info of the old episode.
    assert info["_is_success"].tolist() == [False, True, True] and info["final_info"]["_is_success"].tolist() == [True, False, False]
    assert all_info["is_success"].tolist() == [False, True, True] and info["final_info"]["shift_m"][0] > 0.05
    assert sum(all_info["reward_terms"][term] for term in ("shift", "action")) == pytest.approx(disabled.episodes.task.reward(disabled.episodes.batch, action))


# Oracle: gymnasium's wrappers, unchanged: what they count is what the environments did.
@needs_gymnasium
def test_gymnasiums_vector_wrappers_run_unchanged(tmp_path):
    from gymnasium.wrappers import vector

    env = hs.gym.make_vec("reach", 4, max_episode_steps=10, render_mode="rgb_array" if hs.has_pictures else None)
    if hs.has_pictures and __import__("importlib.util").util.find_spec("moviepy"):
        env = vector.RecordVideo(env, str(tmp_path), episode_trigger=lambda k: k == 0, video_aspect_ratio=(1, 1))
    wrapped = vector.NormalizeReward(vector.NormalizeObservation(vector.RecordEpisodeStatistics(env)))
    wrapped.reset(seed=1)
    for step in range(1, 23):
        observation, *_, truncated, info = wrapped.step(wrapped.action_space.sample())
        assert ("episode" in info) == truncated.any() == (step in (10, 21))
    assert info == {} or observation.shape == wrapped.observation_space.shape
    assert list(wrapped.get_wrapper_attr("length_queue") if hasattr(wrapped, "get_wrapper_attr") else wrapped.env.env.length_queue) == [10] * 8
    wrapped.close()
    if hs.has_pictures and __import__("importlib.util").util.find_spec("moviepy"):
        assert (tmp_path / "rl-video-episode-0.mp4").stat().st_size > 1000


# Oracle: the environment itself.
@needs_gymnasium
@pytest.mark.parametrize("name", ["hold", "reach"])
def test_a_pickled_environment_goes_the_same_way(name):
    import pickle

    import gymnasium

    for env in (hs.gym.make_vec(name, 2, max_episode_steps=7), hs.gym.HandEnv(name, max_episode_steps=7),
                gymnasium.make(f"handsim/{name.title()}-v0", max_episode_steps=7)):
        again = pickle.loads(pickle.dumps(env))
        actions = np.random.default_rng(1).uniform(-1, 1, (9, *env.action_space.shape)).astype(np.float32)
        ways = []
        for each in (env, again):
            way = [each.reset(seed=3)[0]]
            for action in actions:
                observation, reward, terminated, truncated, _ = each.step(action)
                way.append(np.hstack([np.ravel(observation), np.ravel(reward), np.ravel(terminated), np.ravel(truncated)]))
            ways.append(np.concatenate([np.ravel(part) for part in way]))
        assert np.array_equal(*ways) and 1 in ways[0]


@needs_gymnasium
@pytest.mark.parametrize("options, said", [
    ({"render_mode": "human"}, "render_mode: got human, need rgb_array, or None"), ({"autoreset_mode": "Never"}, "autoreset_mode: got Never, need one of gymnasium's"),
    ({"rendered": 3}, "rendered: got 3, need a whole number, 1 to 2"), ({"max_episode_steps": 0}, "max_episode_steps: got 0"),
    ({"person": 2}, "person: got 2, need options of hold: drive, disturbance"), ({"driv": "muscles"}, "driv: got 'muscles'")])
def test_wrong_options_of_an_environment_are_refused_with_their_names(options, said):
    with pytest.raises(hs.Error, match=said):
        hs.gym.make_vec("hold", 2, **options)


# Oracle: stable-baselines3's own vector of single environments, and its learner.
@pytest.mark.parametrize("name", ["Reach", "Hold"])
def test_stable_baselines_vectors_are_those_of_single_environments(name):
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed: its vectors are not tested")
    import gymnasium
    from stable_baselines3.common.vec_env import DummyVecEnv

    ours = hs.gym.sb3_vec(name.lower(), 3, max_episode_steps=20)
    theirs = DummyVecEnv([lambda: gymnasium.make(f"handsim/{name}-v0", max_episode_steps=20)] * 3)
    for env in (ours, theirs):
        env.seed(4)
    assert np.array_equal(ours.reset(), theirs.reset())
    random, ended = np.random.default_rng(0), 0
    for _ in range(45):
        action = random.uniform(-1, 1, (3, 20)).astype(np.float32)
        (*mine, infos), (*others, other) = ours.step(action), theirs.step(action)
        for a, b in zip(mine, others):
            assert a.dtype == b.dtype and np.array_equal(a, b)
        for a, b in zip(infos, other):
            assert {*a} - {"episode"} == {*b} and a["TimeLimit.truncated"] == b["TimeLimit.truncated"] and a["is_success"] == b["is_success"]
            assert ("terminal_observation" in a) == ("episode" in a) and a["reward_terms"] == b["reward_terms"]
            if "terminal_observation" in a:
                assert np.array_equal(a["terminal_observation"], b["terminal_observation"])
                ended += 1
    assert ended >= 6
    ours.set_attr("max_steps", 5)
    assert ours.get_attr("max_steps") == [5] * 3 and ours.env_method("succeeded", ours.unwrapped.env.episodes.batch, indices=[0])[0].shape == (3,)
    with pytest.raises(hs.Error, match="indices: got 0"):
        ours.set_attr("max_steps", 5, indices=0)
    with pytest.raises(hs.Error, match="autoreset_mode: got NextStep"):
        hs.gym.sb3_vec("hold", 1, autoreset_mode="NextStep")


def test_stable_baselines_learns():
    sb3 = pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed: its learners are not tested")
    __import__("torch").set_num_threads(1)
    model = sb3.PPO("MlpPolicy", hs.gym.sb3_vec("pose", 8, max_episode_steps=16), n_steps=32, batch_size=64, seed=1, device="cpu")
    model.learn(512)
    assert model.num_timesteps == 512 and len(model.ep_info_buffer) == 32 and len(model.ep_success_buffer) == 32


# Oracle: every episode ends after five steps, and in gymnasium's NEXT_STEP the sixth step begins the next one.
@needs_gymnasium
@pytest.mark.parametrize("mode", ["NextStep", "Disabled"])
def test_vectors_in_gymnasiums_other_modes_of_reset(two_hands, mode):
    from gymnasium.vector import AutoresetMode

    env = hs.gym.HandVectorEnv(SceneTask(two_hands, lambda batch: np.ones(len(batch)), max_steps=5), 3, autoreset_mode=mode)
    assert env.metadata["autoreset_mode"] == env.autoreset_mode == AutoresetMode(mode)
    first = env.reset(seed=1)[0].copy()
    zeros = np.zeros(env.action_space.shape, np.float32)
    for step in range(1, 12):
        observation, reward, terminated, truncated, info = env.step(zeros)
        assert not terminated.any() and info.get("_failed", np.zeros(3, bool)).all() == (mode == "Disabled" or step != 6)
        if mode == "NextStep":
            assert truncated.tolist() == [step in (5, 11)] * 3 and reward.tolist() == [step != 6] * 3
            assert np.array_equal(observation, first) == (step == 6)
        else:
            # The first is reset by its user; the others remain ended.
            assert truncated.tolist() == [step in (5, 10), step >= 5, step >= 5]
            if truncated[0]:
                again = env.reset(options={"reset_mask": np.array([True, False, False])})[0]
                assert np.array_equal(again[0], first[0]) and not np.array_equal(again[1], first[1])


@needs_gymnasium
def test_make_vec_takes_a_scene_and_a_reward(two_hands):
    env = hs.gym.make_vec(two_hands, 4, reward=lambda batch: batch.u[:, 0], render_mode="rgb_array", rendered=2,
                          max_steps=5)
    env.reset(seed=3)
    _, reward, *_ = env.step(env.action_space.sample())
    assert np.array_equal(reward, env.episodes.batch.u[:, 0])
    if hs.has_pictures:
        assert [picture.shape[2] for picture in env.render()] == [3, 3]
    with pytest.raises(hs.Error, match="reward: got none"):
        hs.gym.make_vec(two_hands, 4)
    with pytest.raises(hs.Error, match="reward: got one beside a task"):
        hs.gym.make_vec("hold", 4, reward=lambda batch: 0)


def _mean_q(seed):
    episodes = Episodes("reach", 4, seed=seed)
    for _ in range(3):
        episodes.step(np.full((4, episodes.task.actions), 0.5))
    return float(episodes.batch.q.mean())


# Oracle: the same in this process.
def test_processes_run_environments_side_by_side():
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert pool.map(_mean_q, [1, 2]) == [_mean_q(1), _mean_q(2)]


# The example runs to its end; the model that it writes is a valid one and says its task.
def test_ppo_writes_a_policy(tmp_path):
    onnx = pytest.importorskip("onnx")
    example = Path(__file__).parents[2] / "python/examples/ppo.py"
    words = ["--task", "reach", "--option", "persons=2", "--environments", "16", "--horizon", "8", "--cpu-minutes", "0.02"]
    done = subprocess.run([sys.executable, str(example), "--out", str(tmp_path), *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert hs.study.read_csv(tmp_path / "curve.csv").rows > 0
    model = onnx.load(str(tmp_path / "policy.onnx"))
    onnx.checker.check_model(model)
    said = {each.key: each.value for each in model.metadata_props}
    assert said["task"] == "reach" and json.loads(said["options"]) == {"drive": "muscles", "persons": 2}


# Oracle: the README's exit status for bad usage, with a message in place of a traceback.
@pytest.mark.parametrize("words, said", ((["nowhere.onnx"], "policy: got nowhere.onnx"), ([__file__, "--option", "persons"], "got persons, need KEY=VALUE"),
                                         ([__file__, "--task", "jump"], "invalid choice: 'jump'")))
def test_playing_refuses_bad_words(tmp_path, words, said):
    done = subprocess.run([sys.executable, "-m", "handsim.gym", "--out", str(tmp_path / "out"), *words], capture_output=True, text=True)
    assert said in done.stderr and "Traceback" not in done.stderr
    assert done.returncode == 2 and not (tmp_path / "out").exists()


# Oracle: the run that a played episode becomes ends where the episode's environment ended.
@pytest.mark.parametrize("drive", ("targets", "muscles"))
def test_a_played_episode_is_a_run(tmp_path, drive):
    from handsim.gym.__main__ import play

    episodes = Episodes(Pose(drive=drive, persons=2), 4)
    task = episodes.task
    play(lambda x: 0.3 * np.sin(x[:, :task.actions]), episodes, "pose", tmp_path, 3)
    end = hs.study.read_csv(tmp_path / "trajectory.csv")
    last = [end[name][-1] for name in task.scene.coordinates]
    assert np.allclose(last, episodes.batch.q[0], atol=1e-9)
    assert (tmp_path / "report.html").exists() == hs.has_reports


# Oracle: the argument's name, and a batch that has not moved.
@pytest.mark.parametrize("strange", [np.inf, -np.inf, np.nan])
def test_an_action_that_is_not_finite_is_refused(two_hands, strange):
    episodes = Episodes(SceneTask(two_hands, lambda batch: np.zeros(len(batch))), 2)
    action = np.zeros((2, episodes.task.actions))
    action[1, 3] = strange
    before = episodes.batch.q.copy()
    with pytest.raises(hs.Error, match=rf"action: got {strange} at \[1, 3\], need finite numbers"):
        episodes.step(action)
    for wrong in ("a", [[1], [1, 2]], None, action[:, 1:], object()):
        with pytest.raises(hs.Error, match="action: got"):
            episodes.step(wrong)
    for mask in (5, [1, 0], np.zeros(3, bool), "a"):
        with pytest.raises(hs.Error, match="mask: got"):
            episodes.reset(mask)
    assert np.array_equal(episodes.batch.q, before)


@pytest.mark.parametrize("options, said", [({"persons": 10**9}, "persons: got 1000000000, need a whole number, 0 to 1024"), ({"persons": -1}, "persons: got -1"),
                                           ({"persons": "x"}, "persons: got 'x'"), ({"persons": 1e9}, "persons: got"), ({"drive": [1]}, "drive: got")])
def test_options_of_a_task_have_bounds(options, said):
    with pytest.raises(hs.Error, match=said):
        Pose(**options)
    with pytest.raises(hs.Error, match="count: got 1000000000, need a whole number, 1 to 1000000"):
        hs.draw_persons(10**9)


RUNTIME = """
import json, types
import numpy as np
class InferenceSession:
    def __init__(self, path, providers):
        self.of = json.load(open(path))
    def get_inputs(self):
        return [types.SimpleNamespace(name="x")]
    def get_modelmeta(self):
        return types.SimpleNamespace(custom_metadata_map={"task": self.of["task"], "options": self.of["options"]})
    def run(self, names, inputs):
        if inputs["x"].shape[1] != self.of["width"]:
            raise Exception("INVALID_ARGUMENT : Got invalid dimensions for input: x")
        return [np.full((len(inputs["x"]), self.of["actions"]), float(self.of["value"]))]
"""


def play_words(folder, out, task="pose", options="{}", width=80, actions=20, value="0"):
    """Plays a policy that gives the same actions to every observation of some width, by a module in the place of onnxruntime."""
    (folder / "modules").mkdir(exist_ok=True)
    (folder / "modules/onnxruntime.py").write_text(RUNTIME)
    (folder / "p.onnx").write_text(json.dumps({"task": task, "options": options, "width": width, "actions": actions, "value": value}))
    path = os.pathsep.join([str(folder / "modules"), os.environ.get("PYTHONPATH", "")])
    return subprocess.run([sys.executable, "-m", "handsim.gym", str(folder / "p.onnx"), "--out", str(out), "--episodes", "2"], capture_output=True, text=True,
                          timeout=120, env={**os.environ, "PYTHONPATH": path})


@pytest.mark.parametrize("given, said", [
    ({"options": "{"}, "options: got '{'"), ({"options": "[1]"}, "options: got"), ({"options": "null"}, "options: got"), ({"options": '{"nope": 1}'}, "got nope, need options of pose: drive"),
    ({"options": '{"self": 2}'}, "got self"), ({"options": '{"persons": 1e9}'}, "persons: got"), ({"options": '{"hands": [1]}'}, "options: got"), ({"options": "[" * 100000}, "options: got"),
    ({"task": "../x"}, "task: got ../x"), ({"width": 7}, "a model that fails on observations of shape"), ({"actions": 3}, "action: got shape"), ({"value": "inf"}, "action: got inf"),
    ({"value": "nan"}, "action: got nan")])
def test_a_policy_that_does_not_fit_is_refused_in_a_sentence(tmp_path, given, said):
    done = play_words(tmp_path, tmp_path / "out", **given)
    assert done.returncode == 2 and said in done.stderr and "Traceback" not in done.stderr and not (tmp_path / "out").exists(), done.stderr


@pytest.mark.parametrize("name", ("actions.csv", "scene/resolved.yaml", "played.mp4"))
def test_playing_keeps_what_it_did_not_write(tmp_path, name):
    mine = tmp_path / "out" / name
    mine.parent.mkdir(parents=True)
    mine.write_text("mine")
    done = play_words(tmp_path, tmp_path / "out")
    assert done.returncode == 2 and mine.read_text() == "mine" and "Traceback" not in done.stderr, done.stderr
    done = play_words(tmp_path, mine)
    assert done.returncode == 2 and "need a folder" in done.stderr and mine.read_text() == "mine", done.stderr


def test_playing_again_replaces_its_own(tmp_path):
    for _ in range(2):
        done = play_words(tmp_path, tmp_path / "out", options='{"drive": "muscles"}', width=101, actions=41, value="-1")
        assert done.returncode == 0 and "new episodes end with success" in done.stdout and (tmp_path / "out/actions.csv").is_file(), done.stderr


# Oracle: two processes simulate every step that is asked for. Ray and PyTorch are wheels of PyPI: pip install "ray[rllib]" torch.
def test_rays_workers_learn_on_vectors(tmp_path):
    for name in ("ray.rllib", "torch", "gymnasium"):
        pytest.importorskip(name, reason=f"{name} is not installed: training with Ray's workers is not tested")
    run = subprocess.run([sys.executable, str(Path(__file__).parents[2] / "python/examples/train_with_ray.py"), "--envs", "4", "--steps", "256", "--iterations", "2"],
                         capture_output=True, text=True, timeout=600, env={**os.environ, "RAY_worker_niceness": "0", "RAY_AUTH_MODE": "disabled"})
    lines = run.stdout.splitlines()
    assert run.returncode == 0 and lines[-1].startswith("2 workers of 4 hands"), run.stderr[-2000:]
    steps = [int(line.split()[0]) for line in lines if "steps a second" in line]
    assert len(steps) == 2 and steps[0] >= 256 and steps[1] >= steps[0] + 256


# Oracle: a scene of each person, in which the object has come to rest: it stays where it is, whoever holds it.
@pytest.mark.parametrize("name, drive", [("turn", "targets"), ("reorient", "targets"), ("pen_twirl", "torques")])
def test_objects_lie_in_every_persons_hand(name, drive):
    task = TASKS[name](drive=drive, persons=4)
    episodes = Episodes(task, 24, seed=1)
    assert set(task.person) == {0, 1, 2, 3}
    start = episodes.batch["objects"][:, :3].copy()
    places = [start[list(task.person).index(k)] for k in range(4)]
    assert min(np.linalg.norm(a - b) for i, a in enumerate(places) for b in places[:i]) > 1e-4
    assert np.abs(task._shift(episodes.batch)).max() < 1e-12
    if drive == "targets":
        for _ in range(10):
            *_, terminated, _ = episodes.step(np.zeros((24, task.actions)))
        assert not terminated.any() and np.abs(episodes.batch["objects"][:, :3] - start).max() < 2e-3


# Oracle: gravity: each person's opened hand drops the can, and holds it by squeezing, with each of the drawn pads.
@pytest.mark.parametrize("drive", ["targets", "torques"])
def test_persons_hold_the_can_by_their_own_grasps(drive):
    task = TASKS["hold"](drive=drive, persons=3, disturbance=0, vary={"contacts.materials.0.friction": {"uniform": [0.7, 1.0]}})
    episodes = Episodes(task, 12, seed=1)
    assert set(task.person) == {0, 1, 2} and len({scene.masses.sum() for scene in task.people}) == 3
    assert np.abs(task._shift(episodes.batch)).max() < 1e-12 and np.ptp(task._start_place, axis=0).max() > 1e-4
    if drive == "targets":
        squeeze = 0.6 * np.array([name.endswith("flexion") for name in task.scene.axes])
        for _ in range(30):
            *_, terminated, _ = episodes.step(np.tile(squeeze, (12, 1)))
        assert not terminated.any()
    dropped = np.zeros(12, bool)
    for _ in range(60):
        *_, terminated, _ = episodes.step(np.zeros((12, task.actions)))
        dropped |= terminated
    assert dropped.all()


# Oracle: the mass that the object's own volume or file has.
def test_an_object_of_ones_own(tmp_path):
    corners = [(x, y, z) for x in (-.02, .02) for y in (-.02, .02) for z in (-.02, .02)]
    faces = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    mesh = tmp_path / "cube.obj"
    mesh.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {' '.join(map(str, face))}\n" for face in faces))
    for given, name, mass in (("golf_ball", "golf_ball", 0.0459), (str(mesh), "cube", 0.06), (mesh, "cube", 0.06),
                              ({"shape": "sphere", "radius": "20 mm", "mass": "30 g"}, "object", 0.03)):
        episodes = Episodes(TASKS["turn"](object=given), 2)
        scene = episodes.task.scene
        assert scene.objects == [name] and scene.masses[scene.bodies.index(name)] == pytest.approx(mass, rel=0.02)
        for _ in range(5):
            *_, terminated, _ = episodes.step(np.zeros((2, 20)))
        assert not terminated.any()
    with pytest.raises(hs.Error, match="object: got object, which falls from the hand"):
        TASKS["turn"](object={"shape": "sphere", "radius": "20 mm", "mass": "30 g", "position": [0.3, 0.11, 0.23]})
    with pytest.raises(hs.Error, match='objects.0.file: got "nope"'):
        TASKS["turn"](object="nope")


# Oracles: bounds of each draw; what a batch draws anew is another in each episode, what makes scenes is one of these.
def test_tasks_draw_numbers_by_the_scenes_keys():
    task = TASKS["turn"](variants=3, vary={"objects.0.mass": {"uniform": ["40 g", "80 g"]}, "objects.0.friction": {"log_uniform": [0.4, 1.2]},
                                           "hands.0.tissue.damping": {"choice": [1, 2]}, "objects.0.position": [0, 0.112, 0.23]})
    episodes = Episodes(task, 64, seed=1)
    mass, friction = (episodes.batch.get(f"objects.0.{key}")[:, 0].copy() for key in ("mass", "friction"))
    assert mass.min() > 0.04 and mass.max() < 0.08 and np.ptp(mass) > 0.03 and len(set(mass)) == 64
    assert friction.min() > 0.4 and friction.max() < 1.2 and len(task.people) == 3 and set(task.person) == {0, 1, 2}
    episodes.reset(seed=2)
    assert not np.any(mass == episodes.batch.get("objects.0.mass")[:, 0])
    same = Episodes(task, 3, seed=2)
    assert np.array_equal(same.batch.get("objects.0.mass")[:, 0], episodes.batch.get("objects.0.mass")[:3, 0])


@pytest.mark.parametrize("vary, said", [
    ({"objects.0.mass": {"uniform": [1]}}, r"vary.objects.0.mass.uniform: got \[1\], need \[low, high\]"),
    ({"objects.0.mass": {"uniform": [2, 1]}}, "vary.objects.0.mass.uniform: got .* need the lower end first"),
    ({"objects.0.mass": {"log_uniform": [0, 1]}}, "need the lower end first, above 0"),
    ({"objects.0.mass": {"around": [1, 2]}}, "vary.objects.0.mass: got .* need one of uniform, log_uniform, normal, choice"),
    ({"q": {"normal": {"mean": 0, "sd": -1}}}, "vary.q.normal.sd: got -1, need 0 or more"), ({"q": {"normal": 1}}, "vary.q.normal: got 1"),
    ({"objects.0.mass": {"uniform": ["a", 1]}}, "vary.objects.0.mass.uniform.0: got 'a', need a finite number"),
    ({"objects.0.mass": {"uniform": ["1 m", "2 m"]}}, "objects.0.mass: got 1 m, need a mass"), ({"objects.0.mass": {"normal": {"mean": -1, "sd": 0}}}, "objects.0.mass: got -1"),
    ({"objects.0.friction": {"uniform": [-1, 1]}}, "objects.0.friction: got -1"),
    ({"objects.0.radios": {"choice": [1]}}, "objects.0.radios"), (5, "vary: got 5, need a mapping")])
def test_wrong_draws_are_refused_with_their_keys(vary, said):
    with pytest.raises(hs.Error, match=said):
        Episodes(TASKS["turn"](vary=vary), 1)


def test_a_scene_of_ones_own_draws_too(two_hands):
    task = SceneTask("two_hands", lambda batch: np.zeros(len(batch)), variants=2, vary={"gravity": {"normal": {"mean": 0, "sd": 1}},
                                                                                       "hands.0.person": {"choice": ["child", "median_man"]}})
    episodes = Episodes(task, 8, seed=1)
    assert len({tuple(row) for row in episodes.batch.get("gravity")}) == 8 and len(task.people) == 2
    episodes.step(np.zeros((8, task.actions)))


# Oracle: what is left without a success, and with one.
@pytest.mark.parametrize("name", TASKS)
def test_infos_have_success_distances_and_terms_of_the_reward(name):
    episodes = Episodes(name, 3, seed=1)
    _, reward, *_ = episodes.step(np.full((3, episodes.task.actions), 0.1))
    info = episodes.info()
    assert sum(info["reward_terms"].values()) == pytest.approx(reward) and not info["failed"].any()
    assert ("is_success" in info) == (name != "turn") and any(key.endswith(("_m", "_rad", "_N")) for key in info)
    assert all(np.shape(value) == (3,) for value in [*info["reward_terms"].values(), *(each for key, each in info.items() if key != "reward_terms")])


# Oracles: gymnasium's own check; the reward of the step is that of its goals, and moves with a goal that is put where the fingers are.
@needs_gymnasium
def test_goals_stand_by_themselves():
    import gymnasium
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*precision lowered.*")
        check_env(gymnasium.make("handsim/Reach-v0", goals=True).unwrapped, skip_render_check=True)
    env = hs.gym.make_vec("reach", 4, goals=True, autoreset_mode="SameStep", max_episode_steps=5)
    env.reset(seed=1)
    for step in range(5):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    assert truncated.all() and not terminated.any() and {*info["final_obs"][0]} == {"observation", "achieved_goal", "desired_goal"}
    last = {key: np.stack([each[key] for each in info["final_obs"]]) for key in info["final_obs"][0]}
    assert np.array_equal(env.compute_reward(last["achieved_goal"], last["desired_goal"], {}), reward) and np.all(reward == -1)
    assert np.all(env.compute_reward(last["achieved_goal"], last["achieved_goal"], {}) == 0)
    with pytest.raises(hs.Error, match="goals: got 1, need True or False"):
        Reach(goals=1)


def test_hindsight_experience_replay_runs():
    sb3 = pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed: its replay of goals is not tested")
    __import__("torch").set_num_threads(1)
    model = sb3.SAC("MultiInputPolicy", hs.gym.sb3_vec("reach", 4, goals=True, max_episode_steps=10), replay_buffer_class=sb3.HerReplayBuffer,
                    learning_starts=60, batch_size=16, policy_kwargs={"net_arch": [16]}, device="cpu")
    model.learn(120)
    # Goals that were given afterwards are reached by some of their episodes' steps.
    assert model.replay_buffer.sample(256).rewards.max() == 0 and model.num_timesteps == 120
