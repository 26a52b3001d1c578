// Finds the files installed with handsim: hand models, persons, controllers, scenes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace handsim {

/// Folder with handmodels/ and config/: of the package, installed, or of the source. @throws Error (input)
std::filesystem::path data_folder();

/// The folder of the file that has this code: of the program, or of the Python module.
std::filesystem::path own_folder();

/// The folder below data_folder() of the files that a key of a YAML file may name: `config/persons` for
/// `hands.0.person`; empty for other keys. @param key dotted path
std::string_view shipped_folder(std::string_view key);

/// Sorted names of the YAML files in a folder below data_folder(): `two_hands`, `stability/stack`; empty if
/// nothing is installed.
std::vector<std::string> shipped_names(std::string_view folder);

/// The shipped file of this name; nothing for a text that is no name, and for other names.
std::optional<std::filesystem::path> shipped_file(const std::filesystem::path& name, std::string_view folder);

inline constexpr std::string_view kAnyFolder;  ///< In find_input(): a shipped file of any kind.

/// The path itself, or a shipped file by its name: `two_hands` for config/two_hands.yaml. A file of the user
/// comes first. @param folder below data_folder(). @throws Error (input) with the nearest name for a name
/// that no shipped file has, and with both for a name that two files of kAnyFolder have
std::filesystem::path find_input(const std::filesystem::path& name, std::string_view folder = "config");

}  // namespace handsim
