// Where the files are that ship with handsim: hand models, persons, controllers, scenes.
#pragma once

#include <filesystem>

namespace handsim {

/// Folder with handmodels/ and config/: the installed one, or the source tree's.
/// @throws Error (input) where neither is there.
std::filesystem::path data_folder();

}  // namespace handsim
