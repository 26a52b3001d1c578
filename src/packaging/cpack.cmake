# Debian packages (./dev package): handsim, the program with its files, libhandsim-dev, the library, and python3-handsim, the
# Python package, without which commands that are written in Python do not run.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME handsim)
set(CPACK_PACKAGE_VENDOR "The handsim authors")
# Who answers for the packages: $MAINTAINER, or who made the last commit.
execute_process(COMMAND git -C ${PROJECT_SOURCE_DIR} log -1 "--format=%an <%ae>;%aD" OUTPUT_VARIABLE commit
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
string(REGEX MATCH "^([^;]*);(.*)$" commit "${commit}")
set(CPACK_PACKAGE_CONTACT "${CMAKE_MATCH_1}")
set(date "${CMAKE_MATCH_2}")
if(NOT "$ENV{MAINTAINER}" STREQUAL "")
  set(CPACK_PACKAGE_CONTACT "$ENV{MAINTAINER}")
endif()
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Biomechanical hands of a given person, simulated")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program dev)
if(TARGET handsim_module)
  list(APPEND CPACK_COMPONENTS_ALL debian_python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME handsim)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "python3-handsim, libosmesa6 | libegl1, libgl1-mesa-dri, fonts-dejavu-core, gnuplot-nox, ffmpeg")
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
    "Builds the left and right hand of a person from stature, body mass and sex,
and simulates them with the Open Dynamics Engine or an engine of its own,
without a display: contact, controllers, muscles, grasps, studies.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libhandsim-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_SHLIBDEPS OFF)
# What handsim-config.cmake looks for, and the shipped models and scenes.
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
    "handsim (= ${PROJECT_VERSION}), libode-dev, libsundials-dev, libomp-dev | libgomp1, libeigen3-dev, libyaml-cpp-dev, libfmt-dev, libqhull-dev, libtbb-dev, libpng-dev, libcairo2-dev, pkg-config")
set(CPACK_COMPONENT_DEV_DESCRIPTION
    "The static library and the headers of handsim, which simulates the hands of
a person, for CMake's find_package(handsim).")

math(EXPR next_python "0${Python_VERSION_MINOR} + 1")
set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_NAME python3-handsim)
set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_SECTION python)
# The module is that of one Python.
set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_DEPENDS
    "handsim (= ${PROJECT_VERSION}), python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}), python3 (<< ${Python_VERSION_MAJOR}.${next_python}), python3-numpy")
set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "python3-h5py")
set(CPACK_DEBIAN_DEBIAN_PYTHON_PACKAGE_SUGGESTS "python3-distributed, python3-aiohttp, python3-yaml, python3-pandas")
set(CPACK_COMPONENT_DEBIAN_PYTHON_DESCRIPTION
    "The Python package of handsim, which simulates the hands of a person, and
the commands that are written in it: rollouts, live, optimise, identify.")

# Debian's policy wants these in every package.
find_program(GZIP gzip)
foreach(pair "program:handsim" "dev:libhandsim-dev" "debian_python:python3-handsim")
  string(REPLACE ":" ";" pair ${pair})
  list(GET pair 0 component)
  list(GET pair 1 package)
  set(folder ${PROJECT_BINARY_DIR}/debian/${package})
  file(MAKE_DIRECTORY ${folder})
  file(WRITE ${folder}/changelog "handsim (${PROJECT_VERSION}) unstable; urgency=medium\n\n  * See CHANGELOG.md of the source.\n\n -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
  execute_process(COMMAND ${GZIP} -9nf ${folder}/changelog)
  file(READ ${PROJECT_SOURCE_DIR}/LICENSE licence)
  file(WRITE ${folder}/copyright "${licence}\nThe file of three.js that reports contain is under the MIT licence: /usr/share/doc/libjs-three/copyright of Debian.\n")
  install(FILES ${folder}/changelog.gz ${folder}/copyright DESTINATION share/doc/${package} COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
include(CPack)
