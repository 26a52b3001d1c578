#include "fuzz/fuzz.h"
#include "handsim/control/gains.h"
#include "handsim/control/poses.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace handsim;
  const std::string text(fuzz::text_of(data, size));
  fuzz::read([&] {
    YamlNode node = parse_yaml(text, fuzz::kPlace);
    Diagnostics diagnostics;
    control::read_controller(node, "", diagnostics);
    diagnostics.throw_if_any();
  });
  return fuzz::read([&] {
    YamlNode node = parse_yaml(text, fuzz::kPlace);
    Diagnostics diagnostics;
    control::read_pose_file(node, "", diagnostics);
    diagnostics.throw_if_any();
  });
}
