#!/usr/bin/env bash
# wheel.sh FOLDER: builds handsim-VERSION-cp3xx-cp3xx-manylinux_2_28_x86_64.whl in FOLDER/dist for each of the Pythons 3.9
# to 3.13 that the path has with its headers (PYTHONS="python3.11 /opt/other/bin/python3.12": for these).
# handsim and its libraries are compiled once; of each Python only the module is. The Pythons need venv and PyPI.
set -euo pipefail
cd "$(dirname "$0")/../.."
mkdir -p "$1"
top=$(cd "$1" && pwd)
plat=manylinux_2_28_x86_64

src/packaging/libraries.sh "$top"
source "$top/environment.sh"
options=(-DHANDSIM_BUNDLE="$top/bundle")
if command -v ccache >/dev/null; then
  options+=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  export CCACHE_SLOPPINESS=pch_defines,time_macros
fi
export CMAKE_ARGS="${options[*]}"

built=0
for python in ${PYTHONS:-python3.9 python3.10 python3.11 python3.12 python3.13}; do
  if ! version=$("$python" -c 'import os, sys, sysconfig
assert os.path.exists(sysconfig.get_path("include") + "/Python.h"), "no headers"
print("%d.%d" % sys.version_info[:2])' 2>/dev/null); then
    echo "wheel: no $python with headers in the path: no wheel for it"
    continue
  fi
  environment=$top/python$version
  if [[ ! -x $environment/bin/pip ]]; then
    "$python" -m venv "$environment"
    "$environment/bin/pip" install -q --disable-pip-version-check 'scikit-build-core>=0.10' 'pybind11>=2.12'
  fi
  echo "wheel: Python $version"
  rm -rf "$top/raw"
  # One tree for all: the libraries' objects stay.
  if ! "$environment/bin/pip" wheel . -q --disable-pip-version-check --no-build-isolation --no-deps -w "$top/raw" \
      --config-settings=build-dir="$top/tree" >"$top/logs/wheel$version" 2>&1; then
    tail -60 "$top/logs/wheel$version"
    exit 1
  fi
  # A name without a version is one that glibc 2.28 lacks.
  rm -rf "$top/unpacked"
  "$top/tools/bin/python" -m zipfile -e "$top"/raw/*.whl "$top/unpacked"
  if nm -D --undefined-only "$top"/unpacked/handsim/*.so | grep ' U ' | grep -vE '@| _?Py'; then
    echo "wheel: these names are missing in src/packaging/old_glibc.c"
    exit 1
  fi
  PATH=$top/tools/bin:$PATH auditwheel repair --plat $plat --only-plat -w "$top/dist" "$top"/raw/*.whl >"$top/logs/audit$version" 2>&1 ||
    { cat "$top/logs/audit$version"; exit 1; }
  built=$((built + 1))
done
[[ $built -gt 0 ]] || { echo "wheel: no Python of 3.9 to 3.13 with headers: install python3-dev and python3-venv"; exit 1; }
for wheel in "$top"/dist/*.whl; do
  echo "$(basename "$wheel"), $(du -h "$wheel" | cut -f1):$("$top/tools/bin/auditwheel" show "$wheel" | tr '\n' ' ' |
    sed 's/.*the following platform tag: \("[^"]*"\).*/ its names fit \1/')"
done
