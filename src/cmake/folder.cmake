# One object library for each folder of src/handsim/. An include is a path below src/. A folder may include its own headers and
# those of the folders in its USES, and no others: test_house compares the includes with the USES.

add_library(handsim_flags INTERFACE)
target_compile_options(handsim_flags INTERFACE -Wall -Wextra -Wconversion -Wshadow
                       $<$<BOOL:${HANDSIM_WERROR}>:-Werror> -ffp-contract=off)
# GCC 12 reports Eigen's fixed-size temporaries as maybe-uninitialized at -O2.
target_compile_options(handsim_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
# In a unity build GCC warns about anonymous namespaces of included .cpp files as if they were headers.
if(HANDSIM_UNITY)
  target_compile_options(handsim_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()

# GCC takes more memory and collects its garbage less often: 7 % of the time of a compilation.
target_compile_options(handsim_flags INTERFACE
                       "$<$<CXX_COMPILER_ID:GNU>:SHELL:--param ggc-min-expand=200 --param ggc-min-heapsize=524288>")
target_include_directories(handsim_flags INTERFACE ${PROJECT_SOURCE_DIR}/src)
target_link_libraries(handsim_flags INTERFACE Eigen3::Eigen fmt::fmt)

# Headers of other libraries that most files use. With HANDSIM_PRECOMPILE they are compiled once for all folders: parsing them
# takes a third of the time of a file. More of them make a file slower than none: <Eigen/Dense> costs a fifth of all time.
set(HANDSIM_PRECOMPILED <algorithm> <array> <cmath> <filesystem> <functional> <limits> <map> <memory> <optional> <span> <string>
                        <string_view> <utility> <vector> <Eigen/Geometry> <fmt/format.h> <fmt/ranges.h>)
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/headers.cpp CONTENT "")
# handsim_headers(TARGET option...): the precompiled headers for targets that are compiled with these options.
function(handsim_headers target)
  add_library(${target} OBJECT ${PROJECT_BINARY_DIR}/headers.cpp)
  target_link_libraries(${target} PRIVATE handsim_flags)
  target_compile_options(${target} PRIVATE ${ARGN})
  target_precompile_headers(${target} PRIVATE ${HANDSIM_PRECOMPILED})
endfunction()
# Other builds have one optimisation for all.
if(CMAKE_BUILD_TYPE STREQUAL Release)
  set(handsim_fast -O3)
  set(handsim_light -O1)
endif()
if(HANDSIM_PRECOMPILE)
  handsim_headers(handsim_headers)
  # What a precompiled header has is compiled with the optimisation of the header: light files take a third longer with -O2's.
  foreach(kind fast light)
    if(handsim_${kind})
      handsim_headers(handsim_headers_${kind} ${handsim_${kind}})
    endif()
  endforeach()
  if(HANDSIM_FUZZ)
    handsim_headers(handsim_headers_fuzzed -fsanitize=fuzzer-no-link)
  endif()
endif()

# Folders that the fuzzer instruments: those that read files. Compiling an instrumented file takes 1.5 times as long.
set(HANDSIM_FUZZED core hand control scene simulation)

# handsim_folder(NAME [LIGHT|FAST] [UNIT name] SOURCES file... USES folder... PRIVATE library...)
# NAME is a folder below src/handsim/; its subfolders need calls of their own. USES names every folder whose headers its files
# include, directly or through another header: USES is not transitive. Every folder may use the standard library,
# Eigen and fmt. LIGHT is for what reads, writes or reports: it takes no noticeable part of a run, and is compiled with -O1.
# FAST is for short inner loops: -O3 saves a tenth of the time of a step with contact, with the same bits.
# A unity build compiles all folders of a UNIT as one file: most of the time of a small folder goes into headers.
function(handsim_folder folder)
  cmake_parse_arguments(arg "LIGHT;FAST" "UNIT" "SOURCES;USES;PRIVATE" ${ARGN})
  string(REPLACE "/" "_" name ${folder})
  set(target handsim_${name})
  if(HANDSIM_UNITY AND arg_UNIT)
    set(target handsim_unit_${arg_UNIT})
  endif()
  list(TRANSFORM arg_SOURCES PREPEND handsim/${folder}/)
  set(first TRUE)
  if(TARGET ${target})
    set(first FALSE)
    target_sources(${target} PRIVATE ${arg_SOURCES})
  else()
    add_library(${target} OBJECT ${arg_SOURCES})
    set_target_properties(${target} PROPERTIES UNITY_BUILD ${HANDSIM_UNITY} UNITY_BUILD_BATCH_SIZE 0)
  endif()
  set_property(GLOBAL PROPERTY HANDSIM_UNIT_OF_${name} ${target})
  target_link_libraries(${target} PRIVATE handsim_flags ${arg_PRIVATE})
  set_property(GLOBAL APPEND PROPERTY HANDSIM_FOLDERS ${folder})
  list(JOIN arg_USES " " uses)
  set_property(GLOBAL APPEND_STRING PROPERTY HANDSIM_USES "${folder} ${uses}\n")
  # The first folder of a unit chooses for all.
  if(NOT first)
    return()
  endif()
  string(REGEX REPLACE "/.*" "" top ${folder})
  set(headers handsim_headers)
  foreach(kind fast light)
    string(TOUPPER ${kind} asked)
    if(arg_${asked} AND handsim_${kind})
      target_compile_options(${target} PRIVATE ${handsim_${kind}})
      set(headers handsim_headers_${kind})
    endif()
  endforeach()
  if(HANDSIM_FUZZ AND top IN_LIST HANDSIM_FUZZED)
    target_compile_options(${target} PRIVATE -fsanitize=fuzzer-no-link)
    set(headers handsim_headers_fuzzed)
  endif()
  if(HANDSIM_PRECOMPILE)
    target_precompile_headers(${target} REUSE_FROM ${headers})
  endif()
endfunction()
