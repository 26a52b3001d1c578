"""compare_builds.py PYTHON_A PYTHON_B [ROUNDS]: CPU times of two installed handsims in turn, and the state hashes that they share.

Each PYTHON is a command, such as build/wheel/try/bin/python or "env PYTHONPATH=build/release/python /usr/bin/python3". Prints the
median of the ratios A / B with quartiles, and the scenes with equal and with other hashes.
"""
import json
import shlex
import statistics
import subprocess
import sys

WORKER = """
import json, sys, time
import numpy as np
import handsim as hs

def cpu(call):
    start = time.process_time()
    call()
    return time.process_time() - start

scene = hs.load("two_hands", engine="articulated")
batch = hs.Batch(scene, 64)
torques = np.full((64, len(scene.coordinates)), 1e-3)
simulations = {
    "articulated, hands": hs.Simulation(scene),
    "articulated, grasp": hs.Simulation(hs.load("grasp_power_can", engine="articulated")),
    "ode, dropped hand": hs.Simulation(hs.load("dropped_hand")),
    "muscles": hs.Simulation(hs.load("muscle_poses")),
}
steps = {"articulated, hands": 40000, "articulated, grasp": 4000, "ode, dropped hand": 600, "muscles": 2000}

def run(name):
    simulations[name].reset()
    simulations[name].step(substeps=steps[name])

for line in sys.stdin:
    if line.strip() == "times":
        out = {"batch": cpu(lambda: batch.step(torques, substeps=200))}
        batch.reset()
        for name in simulations:
            out[name] = cpu(lambda: run(name))
    else:
        out = {}
        for name, engine in (("two_hands", None), ("two_hands", "articulated"), ("dropped_hand", None), ("dropped_hand", "articulated"),
                             ("grasp_power_can", "articulated"), ("grasp_pinch", None), ("muscle_poses", None),
                             ("pose_tracking", None), ("climb_half_crimp", None), ("slider_crank_iftomm", "dae")):
            out[name + (" " + engine if engine else "")] = hs.load(name, engine=engine).run(frames=0).state_hash
    print(json.dumps(out), flush=True)
"""


def main():
    rounds = int(sys.argv[3]) if len(sys.argv) > 3 else 15
    workers = [subprocess.Popen([*shlex.split(command), "-c", WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
               for command in sys.argv[1:3]]

    def ask(worker, what):
        worker.stdin.write(what + "\n")
        worker.stdin.flush()
        return json.loads(worker.stdout.readline())

    ratios = {}
    for round in range(rounds + 1):
        order = (0, 1) if round % 2 else (1, 0)
        times = {which: ask(workers[which], "times") for which in order}
        if round:
            for name in times[0]:
                ratios.setdefault(name, []).append(times[0][name] / times[1][name])
    for name, values in ratios.items():
        quarters = statistics.quantiles(values, n=4)
        print(f"{name:22} {statistics.median(values):.3f}  (quartiles {quarters[0]:.3f} to {quarters[2]:.3f})")
    hashes = [ask(worker, "hashes") for worker in workers]
    for name in hashes[0]:
        print(f"{name:30} {'same bits ' + hashes[0][name] if hashes[0][name] == hashes[1][name] else 'OTHER BITS'}")
    for worker in workers:
        worker.stdin.close()
        worker.wait()


main()
