// How much memory the process can still get.
#pragma once

#include <cstddef>
#include <optional>

namespace handsim {

/// Memory that the process can still get [bytes]: the least of what is left of its address space (ulimit -v),
/// of its control group, and of the machine without swapping. Absent where the system reports none of them.
/// Takes about 30 us.
std::optional<std::size_t> free_memory();

}  // namespace handsim
