// Measures how much memory the process can still allocate.
#pragma once

#include <cstddef>
#include <optional>

namespace handsim {

/// Memory that the process can still allocate [bytes], read from /proc and /sys: the least of its address
/// space (ulimit -v), its control group and the machine without swapping. Absent if nothing is reported.
std::optional<std::size_t> free_memory();

}  // namespace handsim
