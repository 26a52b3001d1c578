// Finds the files installed with handsim: hand models, persons, controllers, scenes.
#pragma once

#include <filesystem>

namespace handsim {

/// Folder with handmodels/ and config/: that of the Python package, the installed one, or the source tree's.
/// @throws Error (input) if none exists.
std::filesystem::path data_folder();

}  // namespace handsim
