#include "fuzz/fuzz.h"
#include "handsim/hand/hand_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace handsim;
  return fuzz::read([&] {
    YamlNode node = parse_yaml(std::string(fuzz::text_of(data, size)), fuzz::kPlace);
    Diagnostics diagnostics;
    hand::read_hand_spec(node, "", diagnostics);
    diagnostics.throw_if_any();
  });
}
