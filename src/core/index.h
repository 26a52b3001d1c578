// The model counts in int, containers in std::size_t.
#pragma once

#include <cstddef>

namespace handsim {

/// Index i >= 0 as a container takes it.
constexpr std::size_t at(std::ptrdiff_t i) { return static_cast<std::size_t>(i); }

}  // namespace handsim
