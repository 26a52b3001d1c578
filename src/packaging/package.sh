#!/usr/bin/env bash
# package.sh FOLDER WHEELS: builds in FOLDER handsim_…_amd64.deb, python3-handsim_…_amd64.deb (where the module is built) and
# libhandsim-dev_…_amd64.deb for this Debian, with its libraries, from build/release, and handsim-…-linux-x86_64.tar.gz, which runs from any folder with glibc 2.28 or newer: the
# program, linked with the libraries of the wheels, which are built in WHEELS. MAINTAINER="Name <mail>" names who answers for
# the packages; without it, who made the last commit.
set -euo pipefail
cd "$(dirname "$0")/../.."
mkdir -p "$1" "$2"
top=$(cd "$1" && pwd)
wheels=$(cd "$2" && pwd)
(cd build/release && cpack -G DEB -B "$top" >"$top/cpack.log") ||
  { cat "$top/cpack.log"; exit 1; }
lintian --tag-display-limit 0 --fail-on error "$top"/*.deb

src/packaging/libraries.sh "$wheels"
(
  source "$wheels/environment.sh"
  if [[ ! -f $wheels/tree/build.ninja ]]; then
    cmake --preset program -B "$wheels/tree" -DHANDSIM_BUNDLE="$wheels/bundle" >"$top/configure.log"
  fi
  cmake --build "$wheels/tree" --target handsim_program
)
name=handsim-$(sed -n 's/^project(handsim VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)-linux-x86_64
rm -rf "${top:?}/$name"
cmake --install "$wheels/tree" --component program --strip --prefix "$top/$name" >"$top/install.log"
cp -r "$wheels/bundle/." "$top/$name/share/handsim"
cp LICENSE README.md "$top/$name"
tar -C "$top" --owner 0 --group 0 -czf "$top/$name.tar.gz" "$name"
rm -r "${top:?}/$name"
ls -lh "$top"/*.deb "$top/$name.tar.gz" | awk '{print $5, $9}'
