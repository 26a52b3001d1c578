// How much memory the process can still get.
#pragma once

#include <cstddef>
#include <optional>

namespace handsim {

/// What limits the memory that the process can still take [bytes]: the least of what its limit of address
/// space leaves (ulimit -v), what its control group leaves and what the machine has without swapping. Absent
/// where the system tells none of them. Costs some 30 us.
std::optional<std::size_t> free_memory();

}  // namespace handsim
