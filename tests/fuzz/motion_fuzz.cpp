#include "fuzz/fuzz.h"
#include "handsim/control/motion_file.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace handsim;
  // The first byte says by which name the file goes.
  if (size == 0) return 0;
  const fuzz::File file(fuzz::text_of(data + 1, size - 1), data[0] % 2 == 0 ? ".csv" : ".mot");
  return fuzz::read([&] {
    const control::MotionTable table = control::read_motion(file.path());
    if (table.values.size() != table.names.size() * table.times.size()) __builtin_trap();
  });
}
