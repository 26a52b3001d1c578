# One object library for each folder of src/. A folder can include its own headers and those of the folders in its
# USES, and no others: each folder has a separate include directory, so that a wrong include does not compile.

add_library(handsim_flags INTERFACE)
target_compile_options(handsim_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow
                       $<$<BOOL:${HANDSIM_WERROR}>:-Werror> -ffp-contract=off)
# GCC 12 reports Eigen's fixed-size temporaries as maybe-uninitialized at -O2.
target_compile_options(handsim_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
# In a unity build GCC warns about anonymous namespaces of included .cpp files as if they were headers.
if(HANDSIM_UNITY)
  target_compile_options(handsim_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()

# Headers that most files use; with HANDSIM_PRECOMPILE they are precompiled for each target, which halves the parse time
# of clang.
set(HANDSIM_PRECOMPILED <algorithm> <array> <cmath> <functional> <map> <memory> <optional> <span> <string> <vector>
                        <Eigen/Dense>)
function(handsim_precompile target)
  if(HANDSIM_PRECOMPILE)
    target_precompile_headers(${target} PRIVATE ${HANDSIM_PRECOMPILED} ${ARGN})
  endif()
endfunction()

# Folders that the fuzzer instruments: those that read files. Compiling an instrumented file takes 1.5 times as long.
set(HANDSIM_FUZZED core hand control scene simulation)

# handsim_folder(NAME SOURCES file... USES folder... PRIVATE library...)
# NAME is a folder below src/; its subfolders need calls of their own. USES names every folder whose headers its files
# include, directly or through another header: USES is not transitive. Every folder may use the standard library and
# Eigen.
function(handsim_folder folder)
  cmake_parse_arguments(arg "" "" "SOURCES;USES;PRIVATE" ${ARGN})
  string(REPLACE "/" "_" name ${folder})
  set(target handsim_${name})
  # The include directory has links to the headers of this folder.
  set(root ${PROJECT_BINARY_DIR}/include/${name})
  file(REMOVE_RECURSE ${root})
  file(MAKE_DIRECTORY ${root}/handsim/${folder})
  file(GLOB headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/src/${folder}/*.h)
  foreach(header IN LISTS headers)
    get_filename_component(file ${header} NAME)
    file(CREATE_LINK ${header} ${root}/handsim/${folder}/${file} SYMBOLIC)
  endforeach()
  list(TRANSFORM arg_SOURCES PREPEND ${folder}/)
  add_library(${target} OBJECT ${arg_SOURCES})
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${HANDSIM_UNITY} UNITY_BUILD_BATCH_SIZE 6)
  set(roots ${root})
  foreach(used IN LISTS arg_USES)
    string(REPLACE "/" "_" used ${used})
    list(APPEND roots ${PROJECT_BINARY_DIR}/include/${used})
  endforeach()
  target_include_directories(${target} PRIVATE ${roots})
  target_link_libraries(${target} PRIVATE handsim_flags Eigen3::Eigen ${arg_PRIVATE})
  set(precompiled)
  if("fmt::fmt" IN_LIST arg_PRIVATE)
    list(APPEND precompiled <fmt/format.h>)
  endif()
  if("nlohmann_json::nlohmann_json" IN_LIST arg_PRIVATE)
    list(APPEND precompiled <nlohmann/json.hpp>)
  endif()
  handsim_precompile(${target} ${precompiled})
  string(REGEX REPLACE "/.*" "" top ${folder})
  if(HANDSIM_FUZZ AND top IN_LIST HANDSIM_FUZZED)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
  endif()
  set_property(GLOBAL APPEND PROPERTY HANDSIM_FOLDERS ${folder})
  list(JOIN arg_USES " " uses)
  set_property(GLOBAL APPEND_STRING PROPERTY HANDSIM_USES "${folder} ${uses}\n")
endfunction()
