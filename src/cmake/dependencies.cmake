# All dependencies of handsim. For each missing one, a message names its Debian package.

# Stops the configure step with a message unless the condition is true.
function(handsim_need condition what package)
  if(NOT ${condition})
    message(FATAL_ERROR "handsim needs ${what}: install the Debian package ${package}, or run ./dev, which installs all it needs.")
  endif()
endfunction()

find_package(PkgConfig QUIET)
handsim_need(PKG_CONFIG_FOUND "pkg-config" pkg-config)

pkg_check_modules(ODE QUIET IMPORTED_TARGET ode>=0.16)
handsim_need(ODE_FOUND "the Open Dynamics Engine (pkg-config ode, 0.16 or newer)" libode-dev)
# The precision of ODE is a choice of its build; its headers use the flag that pkg-config gives.
try_compile(HANDSIM_ODE_IS_DOUBLE ${PROJECT_BINARY_DIR}/ode_precision
            SOURCES ${PROJECT_SOURCE_DIR}/src/handsim/engine/ode/precision.cpp LINK_LIBRARIES PkgConfig::ODE)
handsim_need(HANDSIM_ODE_IS_DOUBLE "ODE built in double precision (this one is single precision or does not link)" libode-dev)

foreach(entry "Eigen3;Eigen 3;libeigen3-dev" "yaml-cpp;yaml-cpp;libyaml-cpp-dev" "fmt;fmt;libfmt-dev"
              "nlohmann_json;nlohmann-json;nlohmann-json3-dev" "CLI11;CLI11;libcli11-dev")
  list(GET entry 0 package)
  list(GET entry 1 what)
  list(GET entry 2 debian)
  find_package(${package} QUIET)
  handsim_need(${package}_FOUND "${what}" ${debian})
endforeach()

find_package(SUNDIALS 6 QUIET COMPONENTS ida cvode nvecserial sunmatrixdense sunlinsoldense)
if(HANDSIM_NEED_SUNDIALS OR HANDSIM_TESTS)
  handsim_need(SUNDIALS_FOUND "SUNDIALS 6 (IDA, and CVODE for tests)" libsundials-dev)
endif()
if(SUNDIALS_FOUND)
  include(CheckCXXSourceCompiles)
  set(CMAKE_REQUIRED_LIBRARIES SUNDIALS::ida)
  check_cxx_source_compiles("
    #include <ida/ida.h>
    static_assert(sizeof(realtype) == sizeof(double), \"not double precision\");
    int main() { return IDAGetReturnFlagName(0) == nullptr; }" HANDSIM_SUNDIALS_IS_DOUBLE)
  unset(CMAKE_REQUIRED_LIBRARIES)
  handsim_need(HANDSIM_SUNDIALS_IS_DOUBLE "SUNDIALS built in double precision (this one has another precision or does not link)"
               libsundials-dev)
endif()

find_package(Qhull QUIET)
handsim_need(Qhull_FOUND "Qhull (convex hulls)" libqhull-dev)
if(NOT TARGET Qhull::qhull_r)
  add_library(Qhull::qhull_r ALIAS Qhull::qhullstatic_r)
endif()

find_package(TBB QUIET)
handsim_need(TBB_FOUND "oneTBB (batches of environments on all cores)" libtbb-dev)
find_path(HANDSIM_RANDOM123 Random123/philox.h)
handsim_need(HANDSIM_RANDOM123 "Random123 (numbers drawn by counter)" librandom123-dev)

set(HANDSIM_PICTURE_LIBRARIES)
set(HANDSIM_GL_HEADERS)
if(HANDSIM_PICTURES)
  # One of the two is enough; Mesa has no OSMesa since version 25.1. Only their headers are needed here: the first picture
  # loads the library of the system.
  foreach(gl EGL OSMESA)
    string(TOLOWER ${gl} name)
    pkg_check_modules(${gl} QUIET IMPORTED_TARGET ${name})
    if(${gl}_FOUND)
      list(APPEND HANDSIM_GL_HEADERS PkgConfig::${gl})
    endif()
  endforeach()
  list(LENGTH HANDSIM_GL_HEADERS gls)
  handsim_need(gls "off-screen OpenGL: EGL or OSMesa" "libegl-dev (or libosmesa6-dev)")
  pkg_check_modules(CAIRO QUIET IMPORTED_TARGET cairo)
  handsim_need(CAIRO_FOUND "cairo (text and layout of contact sheets)" libcairo2-dev)
  find_package(PNG QUIET)
  handsim_need(PNG_FOUND "libpng" libpng-dev)
  list(APPEND HANDSIM_PICTURE_LIBRARIES PkgConfig::CAIRO PNG::PNG)
endif()

# Reports show runs in 3D; without three.js they are refused.
find_file(HANDSIM_THREE three.min.js PATHS /usr/share/javascript/three /usr/share/nodejs/three/build NO_DEFAULT_PATH)
if(NOT HANDSIM_THREE)
  message(STATUS "Without three.js: no reports of runs (libjs-three)")
  set(HANDSIM_THREE "")
endif()

pkg_check_modules(XXHASH QUIET IMPORTED_TARGET libxxhash)
handsim_need(XXHASH_FOUND "xxHash (hashes of states and files)" libxxhash-dev)

if(HANDSIM_TESTS)
  find_package(GTest QUIET)
  handsim_need(GTest_FOUND "GoogleTest" libgtest-dev)
  find_package(rapidcheck QUIET)
  handsim_need(rapidcheck_FOUND "rapidcheck (tests by random input)" librapidcheck-dev)
  find_package(pugixml QUIET)
  handsim_need(pugixml_FOUND "pugixml (reads exported models in tests)" libpugixml-dev)
endif()
if(HANDSIM_BENCHMARKS)
  find_package(benchmark QUIET)
  handsim_need(benchmark_FOUND "Google Benchmark" libbenchmark-dev)
endif()
