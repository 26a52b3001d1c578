#include "fuzz/fuzz.h"
#include "handsim/scene/compile/scene.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace handsim;
  return fuzz::read([&] {
    const scene::Scene scene =
        scene::compile_scene(parse_yaml(std::string(fuzz::text_of(data, size)), fuzz::kPlace));
    static_cast<void>(emit_yaml(scene.resolved));
  });
}
