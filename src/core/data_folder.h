// Finds the files installed with handsim: hand models, persons, controllers, scenes.
#pragma once

#include <filesystem>
#include <string_view>

namespace handsim {

/// Folder with handmodels/ and config/: that of the Python package, the installed one, or the source tree's.
/// @throws Error (input) if none exists.
std::filesystem::path data_folder();

/// The folder of the file that has this code: of the program, or of the Python module.
std::filesystem::path own_folder();

/// The path itself, or a shipped file by its name: `two_hands` for config/two_hands.yaml.
/// @param folder of the shipped file below data_folder()
/// @throws Error (input) with the nearest name for a relative path without an extension that neither has
std::filesystem::path find_input(const std::filesystem::path& name, std::string_view folder = "config");

}  // namespace handsim
