// Reads a regular file of limited size into memory. Refuses pipes, devices and folders without opening them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "handsim/core/error.h"

namespace handsim {

/// All bytes of a file; links are followed.
/// @param need what is accepted, for messages, e.g. `a readable YAML file`. @param most_bytes largest size.
/// @throws Error (input) at the file's first line if it is missing, not a regular file, unreadable or larger.
std::string read_input_file(const std::filesystem::path& path, std::string_view need, std::size_t most_bytes);

/// A size for messages: `64 MB` for whole MB (of 1024 kB), otherwise `10000000 bytes`.
std::string bytes_text(std::size_t bytes);

}  // namespace handsim
