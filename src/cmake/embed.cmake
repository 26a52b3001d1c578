# handsim_embed(FOLDER NAMESPACE FILE...) puts files into the program as string_views: NAMESPACE::page_html for page.html.
# The assembler reads them, so that the compiler need not parse megabytes. NAME=PATH gives a file another name; an empty
# PATH is an empty text.
function(handsim_embed folder namespace)
  string(REPLACE "/" "_" name ${folder})
  set(target handsim_${name})
  get_property(unit GLOBAL PROPERTY HANDSIM_UNIT_OF_${name})
  set(declared)
  set(defined)
  set(depends)
  foreach(entry IN LISTS ARGN)
    if(entry MATCHES "^([a-z_]+)=(.*)$")
      set(name ${CMAKE_MATCH_1})
      set(path ${CMAKE_MATCH_2})
    else()
      get_filename_component(path ${entry} ABSOLUTE)
      get_filename_component(name ${path} NAME)
      string(MAKE_C_IDENTIFIER ${name} name)
    endif()
    if(path STREQUAL "")
      string(APPEND defined "extern const std::string_view ${name} = {};\n")
      continue()
    endif()
    list(APPEND depends ${path})
    set(symbol ${target}_${name})
    string(APPEND declared "__asm__(\".pushsection .rodata\\n.hidden ${symbol}\\n.global ${symbol}\\n${symbol}:\\n.incbin \\\"${path}\\\"\\n\"\n"
                           "        \".hidden ${symbol}_end\\n.global ${symbol}_end\\n${symbol}_end:\\n.byte 0\\n.popsection\\n\");\n"
                           "extern \"C\" const char ${symbol}[], ${symbol}_end[];\n")
    string(APPEND defined "extern const std::string_view ${name} = {${symbol}, static_cast<std::size_t>(${symbol}_end - ${symbol})};\n")
  endforeach()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${target}_assets.cpp)
  file(CONFIGURE OUTPUT ${source} @ONLY CONTENT
       "// Made by cmake/embed.cmake.\n#include <string_view>\n\n@declared@\nnamespace @namespace@ {\n@defined@}\n")
  target_sources(${unit} PRIVATE ${source})
  set_source_files_properties(${source} PROPERTIES OBJECT_DEPENDS "${depends}" SKIP_UNITY_BUILD_INCLUSION ON
                                                   SKIP_PRECOMPILE_HEADERS ON)
endfunction()
