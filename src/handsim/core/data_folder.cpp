#include "handsim/core/data_folder.h"

#include <dlfcn.h>

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/input_file.h"
#include "handsim/core/text.h"
#include "handsim/core/version.h"

namespace handsim {

namespace {

namespace fs = std::filesystem;

struct Shelf {
  std::string_view key, folder;
};
/// By the last part of a key's path that is in this table: `objects` for `objects.0.file`.
constexpr std::array<Shelf, 15> kShelves = {{{"person", "config/persons"},
                                             {"people", "config/persons"},
                                             {"objects", "config/objects"},
                                             {"scene", "config"},
                                             {"costs", "config"},
                                             {"controller", "controllers"},
                                             {"poses", "controllers"},
                                             {"names", "controllers"},
                                             {"model", "handmodels"},
                                             {"hand", "handmodels"},
                                             {"based_on", "handmodels"},
                                             {"anthropometry", "handmodels"},
                                             {"muscles", "handmodels"},
                                             {"strength", "handmodels"},
                                             {"materials", "handmodels"}}};
constexpr std::array<std::string_view, 7> kFolders = {"config",           "config/persons", "config/objects",
                                                      "config/goals",     "controllers",    "handmodels",
                                                      "handmodels/points"};

}  // namespace

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

std::string_view shipped_folder(std::string_view key) {
  while (true) {
    const std::size_t dot = key.rfind('.');
    const std::string_view part = dot == std::string_view::npos ? key : key.substr(dot + 1);
    const auto* found = std::ranges::find(kShelves, part, &Shelf::key);
    if (found != kShelves.end()) return found->folder;
    if (dot == std::string_view::npos) return {};
    key = key.substr(0, dot);
  }
}

std::vector<std::string> shipped_names(std::string_view folder) {
  std::vector<std::string> out;
  try {
    const fs::path top = data_folder() / folder;
    std::error_code failure;
    for (const fs::directory_entry& each : fs::recursive_directory_iterator(top, failure))
      if (each.path().extension() == ".yaml")
        out.push_back(each.path().lexically_relative(top).replace_extension().string());
  } catch (const Error&) {
    // Nothing is installed: only paths are inputs.
  }
  std::ranges::sort(out);
  return out;
}

std::optional<fs::path> shipped_file(const fs::path& name, std::string_view folder) {
  constexpr std::size_t kLongest = 200;
  if (name.empty() || name.native().size() > kLongest || name.is_absolute() || name.has_extension() ||
      name.native().find("..") != std::string::npos)
    return std::nullopt;
  try {
    fs::path shipped = data_folder() / folder / (name.string() + ".yaml");
    if (is_file(shipped)) return shipped;
  } catch (const Error&) {
    // Nothing is installed.
  }
  return std::nullopt;
}

fs::path find_input(const fs::path& name, std::string_view folder) {
  std::error_code failure;
  if (name.is_absolute() || name.has_extension() ||
      (fs::exists(name, failure) && !fs::is_directory(name, failure)))
    return name;
  std::vector<fs::path> found;
  std::vector<std::string> known, paths;
  for (const std::string_view each : kFolders) {
    if (folder != kAnyFolder && each != folder) continue;
    if (const auto shipped = shipped_file(name, each)) {
      found.push_back(*shipped);
      paths.push_back(fmt::format("{}/{}", each, name.string()));
    }
    const std::vector<std::string> names = shipped_names(each);
    known.insert(known.end(), names.begin(), names.end());
  }
  if (found.empty() && folder == kAnyFolder)
    if (const auto shipped = shipped_file(name, "")) return *shipped;
  if (found.size() == 1) return found.front();
  if (found.size() > 1)
    throw input_error(fmt::format("\"{}\"", printable(name.string())), "the name of several shipped files",
                      list_of(paths));
  if (fs::exists(name, failure)) return name;
  throw input_error(
      fmt::format("\"{}\"", printable(name.string())), "no such file, and no shipped one of this name",
      fmt::format("a file, or the name of a shipped one{}", nearest_hint(name.string(), known)));
}

}  // namespace handsim
