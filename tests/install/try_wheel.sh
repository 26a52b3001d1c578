#!/bin/sh
# try_wheel.sh WHEELS [PYTHON]: installs a wheel of the folder WHEELS in a new environment and tries what README shows:
# Python, a run, a page, rollouts, a task. Needs Python 3.9 to 3.13 with venv, and PyPI for numpy, h5py, scipy and gymnasium.
set -eu
wheels=$(cd "$1" && pwd)
python=${2:-python3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"$python" -m venv environment
bin=$work/environment/bin
tag=$("$python" -c 'import sys; print("cp%d%d" % sys.version_info[:2])')
start=$(date +%s.%N)
"$bin/pip" install -q --disable-pip-version-check "$wheels"/handsim-*-"$tag-$tag"-*.whl
end=$(date +%s.%N)
echo "pip install: $(echo "$end $start" | awk '{printf "%.1f", $1 - $2}') s with what it needs; the package has $(du -sm environment/lib/*/site-packages/handsim | cut -f1) MB"
"$bin/pip" install -q --disable-pip-version-check gymnasium

cat >ten_lines.py <<'END'
import handsim as hs
import numpy as np

hand = hs.Hand(stature=1.75, mass=72, sex="male", side="right")     # hand.dimensions, hand.segments, hand.joints; hand.to_mjcf()
scene = hs.load("grasp_power_can", {"objects.0.mass": 0.4}, engine="articulated")
result = scene.run()                                                # result.verdict_table; result.trajectory: numpy arrays by name
sim = hs.Simulation(scene)
sim.step(torques=np.zeros(len(scene.coordinates)))                  # sim.q, sim.contacts
batch = hs.Batch(scene, 1024, randomise={"objects.0.mass": ("uniform", 0.1, 0.5)}, seed=1)
batch.step(np.zeros((1024, len(scene.coordinates))), substeps=10)   # on all cores; batch.q is a view, not a copy
batch.reset(batch.q[:, 0] > 0.1)
print("python:", "held" if result.passed else "failed", hand.dimensions, "pictures:", hs.has_pictures)
END
"$bin/python" ten_lines.py

# step NAME COMMAND...: its time, and its output where it fails.
step() {
  name=$1
  shift
  start=$(date +%s.%N)
  "$@" >log 2>&1 || { cat log; echo "$name failed"; exit 1; }
  end=$(date +%s.%N)
  echo "$name: $(echo "$end $start" | awk '{printf "%.1f", $1 - $2}') s"
}
export PATH="$bin:$PATH"
handsim --version
step "handsim run" handsim run two_hands --out out
sed -n 's/.*"state_hash": *\("[0-9a-f]*"\).*/state hash of two_hands: \1/p' out/summary.json
step "handsim view" handsim view two_hands --no-browser
step "handsim rollouts" handsim rollouts rollouts_free_fall --count 20 --out rollouts
ls rollouts
cat >task.py <<'END'
import handsim as hs

env = hs.gym.make_vec("hold", 8)
env.reset(seed=1)
for _ in range(20):
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
print("task hold:", observation.shape, reward.mean())
END
"$bin/python" task.py
if handsim render two_hands --time 0.5 --out picture.png >log 2>&1; then
  echo "picture: drawn, $(wc -c <picture.png) bytes"
else
  status=$?
  echo "picture: exit status $status: $(cat log)"
  [ $status -eq 2 ]
fi
