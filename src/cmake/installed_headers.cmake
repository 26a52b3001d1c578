# Headers to install: those of docs/library.md, and the headers that these include.
set(HANDSIM_PUBLIC_HEADERS
    core/error.h model/energy.h model/kinematics.h model/markers.h model/model.h model/newton_euler.h model/state.h hand/build.h
    control/controller.h engine/engine.h
    scene/compile/scene.h simulation/simulation.h simulation/watch/standard_watchers.h simulation/run/run.h environment/batch.h
    output/render/draw_list.h output/render/renderer.h)

function(handsim_installed_headers out)
  set(open ${HANDSIM_PUBLIC_HEADERS})
  set(found)
  while(open)
    list(POP_FRONT open header)
    if(NOT header IN_LIST found)
      list(APPEND found ${header})
      # The headers of handsim that it includes, relative to src/handsim/.
      file(STRINGS ${PROJECT_SOURCE_DIR}/src/handsim/${header} lines REGEX "^#include \"handsim/")
      list(TRANSFORM lines REPLACE "^#include \"handsim/([^\"]+)\".*" "\\1")
      list(APPEND open ${lines})
    endif()
  endwhile()
  set(${out} ${found} PARENT_SCOPE)
endfunction()
