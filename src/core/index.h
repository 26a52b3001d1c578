// Model counts in int, as its files do; containers count in std::size_t.
#pragma once

#include <cstddef>

namespace handsim {

/// Where a container has element i >= 0.
constexpr std::size_t at(std::ptrdiff_t i) { return static_cast<std::size_t>(i); }

}  // namespace handsim
