# One object library per folder of src/. A folder sees its own headers and those of the folders it links,
# and no others: each has an include root that holds only itself, so a wrong include does not build.

add_library(handsim_flags INTERFACE)
target_compile_options(handsim_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow
                       $<$<BOOL:${HANDSIM_WERROR}>:-Werror> -ffp-contract=off)
# GCC 12 reports Eigen's fixed-size temporaries as maybe-uninitialized at -O2.
target_compile_options(handsim_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
# Where files are compiled together GCC takes what a file keeps to itself for part of a header.
if(HANDSIM_UNITY)
  target_compile_options(handsim_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()

# Headers that most files of the folders use, read once for each target: clang then parses a file in half the time. The
# default build goes without.
set(HANDSIM_PRECOMPILED <algorithm> <array> <cmath> <functional> <map> <memory> <optional> <span> <string> <vector>
                        <Eigen/Dense>)
function(handsim_precompile target)
  if(HANDSIM_PRECOMPILE)
    target_precompile_headers(${target} PRIVATE ${HANDSIM_PRECOMPILED} ${ARGN})
  endif()
endfunction()

# Folders whose branches guide the fuzzer: those that read files. Instrumented files take half as long again to
# compile.
set(HANDSIM_FUZZED core hand control scene simulation)

# handsim_folder(NAME SOURCES file... USES folder... LIBRARIES public library... PRIVATE library...)
function(handsim_folder folder)
  cmake_parse_arguments(arg "" "" "SOURCES;USES;LIBRARIES;PRIVATE" ${ARGN})
  set(root ${PROJECT_BINARY_DIR}/include/${folder})
  file(MAKE_DIRECTORY ${root}/handsim)
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/src/${folder} ${root}/handsim/${folder} SYMBOLIC)
  add_library(handsim_${folder} OBJECT ${arg_SOURCES})
  set_target_properties(handsim_${folder} PROPERTIES UNITY_BUILD ${HANDSIM_UNITY} UNITY_BUILD_BATCH_SIZE 6)
  target_include_directories(handsim_${folder} PUBLIC ${root})
  list(TRANSFORM arg_USES PREPEND handsim_)
  target_link_libraries(handsim_${folder} PUBLIC ${arg_USES} ${arg_LIBRARIES} PRIVATE handsim_flags ${arg_PRIVATE})
  set(headers)
  if("fmt::fmt" IN_LIST arg_PRIVATE)
    list(APPEND headers <fmt/format.h>)
  endif()
  if("nlohmann_json::nlohmann_json" IN_LIST arg_PRIVATE)
    list(APPEND headers <nlohmann/json.hpp>)
  endif()
  handsim_precompile(handsim_${folder} ${headers})
  if(HANDSIM_FUZZ AND folder IN_LIST HANDSIM_FUZZED)
    target_compile_options(handsim_${folder} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
endfunction()
