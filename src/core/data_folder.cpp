#include "handsim/core/data_folder.h"

#include <dlfcn.h>

#include <string>
#include <vector>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/text.h"
#include "handsim/core/version.h"

namespace handsim {

std::filesystem::path own_folder() {
  static const int kHere = 0;
  Dl_info info{};
  std::error_code none;
  // For a program, dladdr gives only the word by which it was called.
  const bool module = dladdr(&kHere, &info) != 0 && info.dli_fname != nullptr &&
                      std::filesystem::path(info.dli_fname).extension() == ".so";
  return std::filesystem::canonical(module ? info.dli_fname : "/proc/self/exe", none).parent_path();
}

std::filesystem::path data_folder() {
  const std::filesystem::path own = own_folder();
  for (const std::filesystem::path& folder :
       {own / "data", own / "../share/handsim", std::filesystem::path(kInstalledData),
        std::filesystem::path(kSourceData), std::filesystem::path("/usr/share/handsim")}) {
    std::error_code failure;
    if (std::filesystem::is_directory(folder / "handmodels", failure)) return folder.lexically_normal();
  }
  throw input_error("files installed with handsim", fmt::format("no folder {}", kInstalledData),
                    "an installed handsim, or the paths of the files");
}

std::filesystem::path find_input(const std::filesystem::path& name, std::string_view folder) {
  namespace fs = std::filesystem;
  std::error_code failure;
  if (name.is_absolute() || name.has_extension() ||
      (fs::exists(name, failure) && !fs::is_directory(name, failure)))
    return name;
  std::vector<std::string> known;
  try {
    const fs::path top = data_folder() / folder;
    const fs::path shipped = top / (name.string() + ".yaml");
    if (fs::is_regular_file(shipped, failure)) return shipped;
    for (const fs::directory_entry& each : fs::recursive_directory_iterator(top, failure))
      if (each.path().extension() == ".yaml")
        known.push_back(each.path().lexically_relative(top).replace_extension().string());
  } catch (const Error&) {
    // Nothing is installed: only paths are inputs.
  }
  if (fs::exists(name, failure)) return name;
  throw input_error(
      fmt::format("\"{}\"", printable(name.string())), "no such file, and no shipped one of this name",
      fmt::format("a file, or the name of a shipped one{}", nearest_hint(name.string(), known)));
}

}  // namespace handsim
