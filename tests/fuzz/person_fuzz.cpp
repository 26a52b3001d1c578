#include "fuzz/fuzz.h"
#include "handsim/hand/person.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace handsim;
  return fuzz::read([&] {
    YamlNode node = parse_yaml(std::string(fuzz::text_of(data, size)), fuzz::kPlace);
    Diagnostics diagnostics;
    hand::read_person(node, "", diagnostics);
    diagnostics.throw_if_any();
    // What was read has to be read again from what it is written as.
    YamlNode again = parse_yaml(emit_yaml(node), fuzz::kPlace);
    Diagnostics second;
    hand::read_person(again, "", second);
    if (!second.problems.empty()) __builtin_trap();
  });
}
