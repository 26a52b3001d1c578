#!/usr/bin/env bash
# libraries.sh FOLDER: builds what a wheel links, as static libraries in FOLDER/prefix, from the sources of Debian 12
# (apt-get source), with g++ 12 against the names of glibc 2.28, which zig has (PyPI's ziglang, in FOLDER/tools). The
# same compiler as a local build: so a wheel computes the same bits.
# Each library is built once; remove FOLDER/prefix/done to build all again.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$1"
top=$(cd "$1" && pwd)
prefix=$top/prefix glibc=$top/glibc
mkdir -p "$prefix/done" "$prefix/licences" "$prefix/lib/pkgconfig" "$top/sources" "$top/logs"

# Tools of PyPI.
if ! cmp -s "$here/tools.txt" "$top/tools/list"; then
  rm -rf "$top/tools"
  /usr/bin/python3 -m venv "$top/tools"
  "$top/tools/bin/pip" install -q --disable-pip-version-check -r "$here/tools.txt"
  cp "$here/tools.txt" "$top/tools/list"
fi

# Link-time stand-ins for glibc 2.28, and the names that libstdc++ wants beyond it.
if [[ ! -f $glibc/libc.so || $here/old_glibc.c -nt $glibc/libc.so ]]; then
  mkdir -p "$glibc"
  echo 'int main(void) { return 0; }' >"$glibc/empty.c"
  ZIG_GLOBAL_CACHE_DIR=$top/zig "$top/tools/bin/python" -m ziglang cc -target x86_64-linux-gnu.2.28 -fPIE -pie \
    "$glibc/empty.c" -o "$glibc/empty" -lm -lpthread -ldl -lrt
  find "$top/zig" \( -name 'lib*.so.*' -o -name libc_nonshared.a -o -name Scrt1.o \) -exec cp {} "$glibc" \;
  gcc -O2 -fPIC -c "$here/old_glibc.c" -o "$glibc/old_glibc.o"
  ar rcs "$glibc/libold.a" "$glibc/old_glibc.o"
  for name in m pthread dl rt; do ln -sf "$(basename "$glibc/lib$name.so."*)" "$glibc/lib$name.so"; done
  echo "GROUP ( $glibc/libc.so.6 AS_NEEDED ( $glibc/libpthread.so.0 $glibc/libdl.so.2 $glibc/librt.so.1 $glibc/libld.so.2 ) \
$glibc/libc_nonshared.a $glibc/libold.a )" >"$glibc/libc.so"
fi

export CFLAGS="-O2 -fPIC" CXXFLAGS="-O2 -fPIC"
# -B, not -L: the build of HDF5 would run programs with the folders of -L.
export LDFLAGS="-B$glibc -B$prefix/lib -static-libstdc++ -Wl,--allow-shlib-undefined"
export PKG_CONFIG_LIBDIR=$prefix/lib/pkgconfig CMAKE_GENERATOR=Ninja
if command -v ccache >/dev/null; then
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
fi

# apt with lists of its own, so that the system's configuration stays as it is.
apt=(-o Dir::Etc::sourcelist="$top/apt/sources.list" -o Dir::Etc::sourceparts=/dev/null
     -o Dir::State::lists="$top/apt/lists" -o Dir::Cache="$top/apt/cache" -o APT::Sandbox::User=root)
if [[ ! -f $top/apt/sources.list ]]; then
  mkdir -p "$top/apt/lists/partial" "$top/apt/cache/archives/partial"
  mirror=http://deb.debian.org
  signed='[signed-by=/usr/share/keyrings/debian-archive-keyring.gpg]'
  printf '%s\n' "deb-src $signed $mirror/debian bookworm main" "deb-src $signed $mirror/debian-security bookworm-security main" \
    >"$top/apt/sources.list"
fi

# fetch PACKAGE: prints the folder with its source: the newest; where the mirror lacks it, that of the first release;
# then the upstream archive alone.
fetch() {
  local folder=$top/sources/$1
  if [[ ! -d $folder ]]; then
    [[ -f $top/apt/updated ]] || { apt-get "${apt[@]}" update -qq >&2; touch "$top/apt/updated"; }
    mkdir -p "$folder.part"
    (cd "$folder.part"
     apt-get "${apt[@]}" source -qq --only-source "$1" || apt-get "${apt[@]}" source -qq --only-source "$1/bookworm" ||
       { apt-get "${apt[@]}" source -qq --only-source --tar-only "$1" && tar xf ./*.orig.tar.*; }) >"$top/logs/$1.fetch" 2>&1
    mv "$folder.part" "$folder"
  fi
  echo "$folder"/*/
}

# build NAME COMMAND...: runs a command in the source of Debian's package NAME, once, and keeps its licence.
build() {
  local name=$1 source log=$top/logs/$1
  [[ -f $prefix/done/$name ]] && return
  echo "libraries: $name"
  source=$(fetch "$name")
  if ! (cd $source && "${@:2}") >"$log" 2>&1; then
    tail -40 "$log"
    echo "libraries: $name failed; all of its output is in $log"
    exit 1
  fi
  for file in "$source"/debian/copyright "$source"/{COPYING,LICENSE}*; do
    if [[ -f $file ]]; then cp "$file" "$prefix/licences/$name.txt"; break; fi
  done
  touch "$prefix/done/$name"
}
by_cmake() {
  cmake -S . -B out -DCMAKE_INSTALL_PREFIX="$prefix" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_INSTALL_LIBDIR=lib \
    -DCMAKE_BUILD_TYPE=Release -DCMAKE_C_FLAGS_RELEASE="-O2 -DNDEBUG" -DCMAKE_CXX_FLAGS_RELEASE="-O2 -DNDEBUG" \
    -DBUILD_SHARED_LIBS=OFF -DBUILD_TESTING=OFF "$@" &&
    cmake --build out && cmake --install out
}
# Debian's patches make configure.ac newer than what autotools made of it.
made=(ACLOCAL=: AUTOCONF=: AUTOHEADER=: AUTOMAKE=:)
by_configure() {
  ./configure --prefix="$prefix" --libdir="$prefix/lib" --disable-shared --enable-static --disable-dependency-tracking "$@" &&
    make -C "${part:-.}" -j "$(nproc)" "${made[@]}" && make -C "${part:-.}" "${made[@]}" install
}
by_configure_of_zlib() { ./configure --static --prefix="$prefix" && make libz.a && make install; }
# A pkg-config file: static libraries do not say what they need.
pc() { printf 'Name: %s\nDescription: %s\nVersion: %s\nCflags: -I%s\nLibs: -L%s %s\n' "$1" "$1" "$2" "$prefix/include" "$prefix/lib" "$3" >"$prefix/lib/pkgconfig/$1.pc"; }

build libccd by_cmake -DENABLE_DOUBLE_PRECISION=ON
build ode by_configure --enable-double-precision --enable-libccd --with-libccd=system
pc ode 0.16.2 "-lode -lccd"
build yaml-cpp by_cmake -DYAML_CPP_BUILD_TOOLS=OFF -DYAML_CPP_BUILD_TESTS=OFF
build fmtlib by_cmake -DFMT_TEST=OFF
build qhull by_cmake -DLINK_APPS_SHARED=OFF
build onetbb by_cmake -DTBB_TEST=OFF -DTBBMALLOC_BUILD=OFF -DTBB_STRICT=OFF -DTBB_DISABLE_HWLOC_AUTOMATIC_SEARCH=ON
build sundials by_cmake -DBUILD_STATIC_LIBS=ON -DEXAMPLES_ENABLE_C=OFF -DEXAMPLES_ENABLE_CXX=OFF -DBUILD_ARKODE=OFF \
  -DBUILD_CVODES=OFF -DBUILD_IDAS=OFF -DBUILD_KINSOL=OFF
build zlib by_configure_of_zlib
build libpng1.6 by_configure CPPFLAGS="-I$prefix/include"
build pixman by_configure --disable-gtk --disable-libpng
build freetype by_configure --with-zlib=yes ZLIB_CFLAGS="-I$prefix/include" ZLIB_LIBS=-lz --with-bzip2=no --with-png=no --with-harfbuzz=no --with-brotli=no
part=src build cairo by_configure --disable-xlib --disable-xcb --disable-fc --enable-ft --disable-ps --disable-pdf --disable-svg \
  --disable-script --disable-interpreter --disable-gobject --disable-trace --disable-gl --disable-lto \
  FREETYPE_CFLAGS="-I$prefix/include/freetype2" FREETYPE_LIBS="-lfreetype" CPPFLAGS="-I$prefix/include"
pc cairo 1.16.0 "-Wl,--wrap=cairo_select_font_face -lhandsim_fonts -lcairo -lpixman-1 -lfreetype -lpng16 -lz -lm"
sed -i "s|^Cflags:.*|Cflags: -I$prefix/include/cairo -I$prefix/include|" "$prefix/lib/pkgconfig/cairo.pc"

if [[ $here/bundled_fonts.c -nt $prefix/lib/libhandsim_fonts.a ]]; then
  gcc $CFLAGS -I"$prefix/include/cairo" -I"$prefix/include/freetype2" -c "$here/bundled_fonts.c" -o "$top/bundled_fonts.o"
  ar rcs "$prefix/lib/libhandsim_fonts.a" "$top/bundled_fonts.o"
fi
# Of OpenGL only the headers are needed.
pc egl 1.5 ""
pc osmesa 8.0 ""

# Files that a wheel has because a bare system lacks them.
mkdir -p "$top/bundle/fonts" "$top/bundle/licences"
cp /usr/share/fonts/truetype/dejavu/DejaVuSans{,-Bold}.ttf "$top/bundle/fonts"
cp "$prefix"/licences/* "$top/bundle/licences"
for package in fonts-dejavu-core libeigen3-dev nlohmann-json3-dev libcli11-dev librandom123-dev libxxhash-dev libjs-three libstdc++6; do
  cp "/usr/share/doc/$package/copyright" "$top/bundle/licences/$package.txt"
done

# What a build against these libraries sets.
cat >"$top/environment.sh" <<END
export CFLAGS="$CFLAGS" CXXFLAGS="$CXXFLAGS" LDFLAGS="$LDFLAGS" PKG_CONFIG_PATH="$prefix/lib/pkgconfig" CMAKE_GENERATOR=Ninja
export CMAKE_PREFIX_PATH="$prefix"
END
