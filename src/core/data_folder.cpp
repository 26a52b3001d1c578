#include "handsim/core/data_folder.h"

#include <dlfcn.h>

#include "handsim/core/error.h"

namespace handsim {

namespace {

/// Folder `data` beside the file that has this code: the Python module's.
std::filesystem::path beside_this() {
  static const int kHere = 0;
  Dl_info info{};
  if (dladdr(&kHere, &info) == 0 || info.dli_fname == nullptr) return {};
  return std::filesystem::path(info.dli_fname).parent_path() / "data";
}

}  // namespace

std::filesystem::path data_folder() {
  std::error_code none;
  if (const std::filesystem::path own = beside_this();
      std::filesystem::is_directory(own / "handmodels", none))
    return own;
  for (const char* folder : {HANDSIM_INSTALLED_DATA, HANDSIM_SOURCE_DATA}) {
    std::error_code failure;
    if (std::filesystem::is_directory(std::filesystem::path(folder) / "handmodels", failure)) return folder;
  }
  throw input_error("files installed with handsim", "no folder " HANDSIM_INSTALLED_DATA,
                    "an installed handsim, or the paths of the files");
}

}  // namespace handsim
