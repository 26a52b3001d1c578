// Measures how much memory the process can still allocate.
#pragma once

#include <cstddef>
#include <optional>

namespace handsim {

/// Memory that the process can still allocate [bytes]: the smallest of the rest of its address space
/// (ulimit -v), of its control group, and of the machine without swapping. Absent if the system reports none
/// of them. Reads files of /proc and /sys on each call.
std::optional<std::size_t> free_memory();

}  // namespace handsim
