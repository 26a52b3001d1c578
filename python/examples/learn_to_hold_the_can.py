"""Learns to hold a can that random forces pull at, with a plain evolution strategy. Needs numpy only.

    python3 python/examples/learn_to_hold_the_can.py --out out/learn

The policy is a linear function of the can's shift and velocity: 20 joints times 7 numbers. In each generation every
environment of one batch runs another disturbed policy for an episode; the policy moves along the sum of the disturbances
weighted by the ranks of their returns (Salimans et al. 2017). Writes curve.csv, curve.png (with matplotlib or gnuplot),
film_strip.png (before and after), policy.npy and, with ffmpeg, learned.mp4 and learned.gif: left before, right after.
"""
import argparse
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np

import handsim as hs
from handsim.gym import Episodes, Hold

SHIFT, VELOCITY = 0.02, 0.2  # of a feature of 1 [m], [m/s]


def features(task, observation):
    """1, shift and velocity of the can, shape (n, 7)."""
    can = observation[:, -13:]
    return np.hstack([np.ones((len(can), 1)), can[:, :3] / SHIFT, can[:, 7:10] / VELOCITY])


def episode(episodes, policies, seed=None, watch=None):
    """One episode of every environment with a policy each, shape (n, actions, 7).

    :returns: return and whether the can was held to the end, shape (n,)
    """
    observation = episodes.reset(seed=seed)
    total, alive = np.zeros(len(policies)), np.ones(len(policies), bool)
    for step in range(episodes.task.max_steps):
        action = np.tanh(np.einsum("naf,nf->na", policies, features(episodes.task, observation)))
        observation, reward, terminated, _ = episodes.step(action)
        total += alive * reward
        alive &= ~terminated
        if watch is not None and step in watch:
            watch[step] = episodes.batch.frame(0)
    return total, alive


def ranks(values):
    """Ranks from -0.5 to 0.5."""
    return np.argsort(np.argsort(values)) / (len(values) - 1) - 0.5


def learn(episodes, generations, rate, spread, random):
    """:returns: the policy, and a row for each generation: number, mean and best return, share held, seconds"""
    n = len(episodes.batch)
    policy = np.zeros((episodes.task.actions, 7))
    rows, start = [], time.perf_counter()
    for generation in range(generations):
        half = random.normal(size=(n // 2, *policy.shape))
        noise = np.concatenate([half, -half])
        returns, held = episode(episodes, policy + spread * noise)
        policy = policy + rate / spread * np.tensordot(ranks(returns), noise, 1) / n
        rows.append([generation, returns.mean(), returns.max(), held.mean(), time.perf_counter() - start])
        if generation % 5 == 0 or generation == generations - 1:
            print("generation {:3d}: return {:6.1f} (best {:6.1f}), held {:4.0%}, {:5.1f} s".format(*rows[-1]))
    return policy, np.array(rows)


def draw_curve(rows, folder):
    np.savetxt(folder / "curve.csv", rows, "%.4g", ",", header="generation,mean_return,best_return,held,time[s]", comments="")
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        return draw_curve_by_gnuplot(folder)
    figure, axis = pyplot.subplots(figsize=(8, 4.5), dpi=120, layout="constrained")
    axis.plot(rows[:, 0], rows[:, 1], color="tab:blue", label="mean return")
    axis.plot(rows[:, 0], rows[:, 2], color="tab:blue", alpha=0.4, label="best return")
    axis.set(xlabel="generation", ylabel="return of an episode (at most 100)", title="learning to hold a can")
    other = axis.twinx()
    other.plot(rows[:, 0], 100 * rows[:, 3], color="tab:orange", label="held to the end")
    other.set(ylabel="episodes in which the can is held, %", ylim=(-2, 102))
    lines = axis.get_lines() + other.get_lines()
    axis.legend(lines, [line.get_label() for line in lines], loc="lower right")
    axis.grid(alpha=0.3)
    figure.savefig(folder / "curve.png")


def draw_curve_by_gnuplot(folder):
    if not shutil.which("gnuplot"):
        return print("no curve.png: neither matplotlib nor gnuplot is installed")
    subprocess.run(["gnuplot"], text=True, check=True, cwd=folder, input="""
set terminal pngcairo size 960,540; set output 'curve.png'; set datafile separator ','; set grid; set key bottom right
set title 'learning to hold a can'; set xlabel 'generation'; set ylabel 'return of an episode (at most 100)'
set y2label 'episodes in which the can is held, %'; set y2tics; set y2range [-2:102]; set ytics nomirror
plot 'curve.csv' skip 1 using 1:2 with lines lw 2 title 'mean return', '' skip 1 using 1:3 with lines title 'best return', \\
     '' skip 1 using 1:(100*$4) axes x1y2 with lines lw 2 title 'held to the end'
""")


def draw_film(scene, films, folder):
    """Both episodes side by side: in real time, and as a small GIF at half the speed."""
    if not shutil.which("ffmpeg"):
        return print("no learned.mp4: ffmpeg is not installed")
    frames = [list(film.values()) for film in films]
    sides = [scene.draw_frames(each, size=(320, 240)) for each in frames]
    both = [np.hstack(pair) for pair in zip(*sides)]
    hs.save_video(both, folder / "learned.mp4", 50)
    # Ten frames a second show 50 of the 100 steps.
    hs.save_video(both[:50:2], folder / "learned.gif", 12.5)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/learn"))
    parser.add_argument("--generations", type=int, default=40)
    parser.add_argument("--environments", type=int, default=64)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)

    start = time.perf_counter(), time.process_time()
    episodes = Episodes(Hold(), arguments.environments, seed=arguments.seed)
    policy, rows = learn(episodes, arguments.generations, 0.3, 0.1, np.random.default_rng(arguments.seed))
    print("learned in {:.0f} s, {:.0f} s of CPU time".format(time.perf_counter() - start[0], time.process_time() - start[1]))
    np.save(arguments.out / "policy.npy", policy)
    draw_curve(rows, arguments.out)

    pictures, captions, films = [], [], []
    for name, of in (("before", np.zeros_like(policy)), ("after", policy)):
        # The same new disturbances before and after.
        watch = {step: None for step in range(episodes.task.max_steps)}
        returns, held = episode(episodes, np.tile(of, (arguments.environments, 1, 1)), seed=1000, watch=watch)
        print(f"{name} learning: return {returns.mean():.1f}, held in {held.sum()} of {len(held)} new episodes")
        films.append(watch)
        for step in (0, 4, 9, 49, 99):
            pictures.append(watch[step])
            captions.append(f"{name}, {0.02 * (step + 1):.2f} s")
    if hs.has_pictures:
        scene = episodes.task.scene
        hs.save_png(hs.contact_sheet(scene.draw_frames(pictures), captions, "holding a can against random forces", 1400),
                    arguments.out / "film_strip.png")
        draw_film(scene, films, arguments.out)
    print(f"files in {arguments.out}")


if __name__ == "__main__":
    main()
