// The model's indices are int, those of containers std::size_t.
#pragma once

#include <cstddef>

namespace handsim {

/// Converts an index i >= 0 for a container.
constexpr std::size_t as_index(std::ptrdiff_t i) { return static_cast<std::size_t>(i); }

}  // namespace handsim
