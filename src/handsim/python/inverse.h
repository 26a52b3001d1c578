// What inverse dynamics is asked for, as Python says it.
#pragma once

#include <filesystem>
#include <optional>
#include <tuple>

#include "handsim/study/inverse/inverse.h"

namespace handsim::python {

using OptionalPath = std::optional<std::filesystem::path>;
/// Motion, names, loads, cut-off [Hz], clamp, least activation.
using InverseAsked =
    std::tuple<OptionalPath, OptionalPath, OptionalPath, std::optional<double>, bool, std::optional<double>>;

/// The input, without the check. @throws Error (input) for a file of names that is none
study::InverseInput inverse_input(const InverseAsked& asked);

}  // namespace handsim::python
