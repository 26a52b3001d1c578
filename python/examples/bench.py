"""Costs of the Python package: PYTHONPATH=build/release/python python3 python/examples/bench.py"""
import statistics
import subprocess
import sys
import time

import numpy as np

import handsim as hs


def cpu_of(call):
    start = time.process_time()
    call()
    return time.process_time() - start


def step_ratio(n=1024, substeps=10, rounds=21):
    """CPU time of batch.step from Python over that of the C++ loop, in turn; median of rounds of 4 steps each."""
    scene = hs.load("two_hands", engine="articulated")
    batch = hs.Batch(scene, n)
    torques = np.full((n, len(scene.coordinates)), 1e-3)

    def python():
        for _ in range(4):
            batch.step(torques, substeps=substeps)

    def cpp():
        batch._core.repeat(torques, substeps, 4)

    batch.step(torques, substeps=substeps)
    times, ratios = [], []
    for round in range(rounds):
        batch.reset()
        first, second = (python, cpp) if round % 2 == 0 else (cpp, python)
        a = cpu_of(first)
        batch.reset()
        b = cpu_of(second)
        ours, theirs = (a, b) if round % 2 == 0 else (b, a)
        times.append(ours / (4 * n * substeps))
        ratios.append(ours / theirs)
    quarters = statistics.quantiles(ratios, n=4)
    print(f"batch.step of {n} environments, {substeps} substeps: {statistics.median(ratios):.3f} of the C++ loop "
          f"(quartiles {quarters[0]:.3f} to {quarters[2]:.3f}); {1 / statistics.median(times):,.0f} steps a second of CPU time")


def step_cost(calls=20_000):
    """One simulation, a call for each step."""
    scene = hs.load("two_hands", engine="articulated")
    simulation = hs.Simulation(scene)
    torques = np.zeros(len(scene.coordinates))

    def one_by_one():
        simulation.reset()
        for _ in range(calls):
            simulation.step(torques)

    def at_once():
        simulation.reset()
        simulation.step(torques, substeps=calls)

    a, b = min(cpu_of(one_by_one) for _ in range(5)), min(cpu_of(at_once) for _ in range(5))
    print(f"a call of simulation.step costs {1e6 * (a - b) / calls:.2f} us beside the step's {1e6 * b / calls:.2f} us")


def import_time(repeats=11):
    """CPU time of `import handsim` with numpy in a new process, beside that of numpy alone."""
    def once(module):
        code = f"import time; t = time.process_time(); import {module}; print(time.process_time() - t)"
        return float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)

    with_numpy, numpy_alone = (statistics.median(once(module) for _ in range(repeats)) for module in ("handsim", "numpy"))
    print(f"import handsim: {with_numpy:.3f} s, of which numpy {numpy_alone:.3f} s")


if __name__ == "__main__":
    import_time()
    step_cost()
    step_ratio()
