#!/bin/bash
# bare_systems.sh [WHEELS [PACKAGES]]: makes small Debian systems without compiler (mmdebstrap) and tries in them the wheels,
# the Debian packages and the archive of ./dev wheel and ./dev package. Prints times and sizes; exits with 1 where one fails.
# For root, on Debian; takes some minutes and 3 GB in $TMPDIR. SUITES="bullseye bookworm trixie" chooses the systems.
set -euo pipefail
cd "$(dirname "$0")/../.."
wheels=$(cd "${1:-build/wheel/dist}" && pwd)
packages=$(cd "${2:-build/package}" 2>/dev/null && pwd || true)
mirror=${MIRROR:-http://deb.debian.org/debian}
command -v mmdebstrap >/dev/null || { echo "bare_systems: install mmdebstrap"; exit 2; }
[[ $(id -u) -eq 0 ]] || { echo "bare_systems: only root can make systems"; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
failed=0

# inside ROOT COMMAND...: runs it there with /proc and /dev, which go away with the command.
inside() {
  unshare --mount --fork bash -c 'mount --make-rprivate / && mount -t proc proc "$1/proc" && mount --rbind /dev "$1/dev" &&
    exec chroot "$1" "${@:2}"' inside "$@"
}
# timed NAME COMMAND...: prints the time, and the output where it fails.
timed() {
  local start=$EPOCHREALTIME
  "${@:2}" >"$work/log" 2>&1 || { cat "$work/log"; return 1; }
  awk -v name="$1" -v a="$start" -v b="$EPOCHREALTIME" 'BEGIN {printf "%s: %.1f s\n", name, b - a}'
}
# try NAME COMMAND...: in a process of its own, so that its first failure ends it.
try() {
  "${@:2}" &
  wait $! || { echo "bare_systems: $1 failed"; failed=1; }
}

# new_system SUITE ROOT PACKAGES: with the network settings and pip's settings of this machine.
new_system() {
  mmdebstrap --quiet --variant=minbase --include="$3" "$1" "$2" "$mirror"
  for file in /etc/resolv.conf /etc/hosts /etc/pip.conf /etc/ssl/certs/ca-certificates.crt; do
    if [[ -e $file ]]; then cp -L "$file" "$2$file"; fi
  done
}

try_archive() {
  tar -C "$1/opt" -xzf "$packages"/handsim-*.tar.gz
  echo "archive: $(du -h "$packages"/handsim-*.tar.gz | cut -f1)"
  inside "$1" /bin/sh -c 'cd /tmp && set -- /opt/handsim-*/bin/handsim && "$1" --version && "$1" run two_hands --out archive | tail -1 &&
    sed -n "s/.*\"state_hash\": *\(\"[0-9a-f]*\"\).*/state hash of two_hands: \1/p" archive/summary.json'
}

try_packages() {
  inside "$1" apt-get update -qq
  timed "install handsim" inside "$1" sh -c 'apt-get install -qq -y --no-install-recommends /packages/handsim_*.deb'
  inside "$1" handsim --version
  timed "run" inside "$1" handsim run two_hands --out /tmp/out
  timed "install python3-handsim" inside "$1" sh -c 'apt-get install -qq -y --no-install-recommends /packages/python3-handsim_*.deb'
  inside "$1" handsim rollouts rollouts_free_fall --count 2 --engine articulated --out /tmp/rollouts
  timed "install libhandsim-dev, g++ and cmake" inside "$1" \
    sh -c 'apt-get install -qq -y --no-install-recommends /packages/libhandsim-dev_*.deb g++ cmake make'
  timed "find_package(handsim), build" inside "$1" sh -c 'cmake -S /consumer -B /tmp/consumer && cmake --build /tmp/consumer'
  inside "$1" /tmp/consumer/consumer /usr/share/handsim/config/two_hands.yaml | tail -1
  inside "$1" apt-get purge -qq -y handsim python3-handsim libhandsim-dev >/dev/null
  local left
  left=$(find "$1" -xdev -iname '*handsim*' -not -path "$1/packages/*" -not -path "$1/tmp/*")
  if [[ -n $left ]]; then echo "left behind: $left"; return 1; fi
  echo "removed without a trace"
}

for suite in ${SUITES:-bullseye bookworm}; do
  root=$work/$suite
  echo "== $suite"
  new_system "$suite" "$root" python3,python3-venv,ca-certificates
  mkdir "$root/wheels"
  cp "$wheels"/*.whl "$root/wheels"
  ls -l "$wheels"/*.whl | awk '{printf "%.1f MB %s\n", $5 / 1e6, $9}' | sed 's|/[^ ]*/||'
  cp tests/install/try_wheel.sh "$root"
  try "the wheel in $suite" inside "$root" /bin/sh /try_wheel.sh /wheels
  if [[ -n $packages ]]; then try "the archive in $suite" try_archive "$root"; fi
  rm -rf "$root"
done

if [[ -n $packages ]]; then
  root=$work/debian
  echo "== Debian packages"
  new_system bookworm "$root" ca-certificates
  mkdir "$root/packages"
  cp "$packages"/*.deb "$root/packages"
  cp -r tests/consumer "$root/consumer"
  ls -l "$packages"/*.deb | awk '{printf "%.1f MB %s\n", $5 / 1e6, $9}' | sed 's|/[^ ]*/||'
  export DEBIAN_FRONTEND=noninteractive
  try "the packages" try_packages "$root"
fi
exit $failed
