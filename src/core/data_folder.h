// Finds the files installed with handsim: hand models, persons, controllers, scenes.
#pragma once

#include <filesystem>
#include <string_view>

namespace handsim {

/// Folder with handmodels/ and config/: of the package, installed, or of the source. @throws Error (input)
std::filesystem::path data_folder();

/// The folder of the file that has this code: of the program, or of the Python module.
std::filesystem::path own_folder();

/// The path itself, or a shipped file by its name: `two_hands` for config/two_hands.yaml. @param folder below
/// data_folder(). @throws Error (input) with the nearest name for a name that no shipped file has
std::filesystem::path find_input(const std::filesystem::path& name, std::string_view folder = "config");

}  // namespace handsim
