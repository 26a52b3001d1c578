#include "handsim/core/data_folder.h"

#include "handsim/core/error.h"

namespace handsim {

std::filesystem::path data_folder() {
  for (const char* folder : {HANDSIM_INSTALLED_DATA, HANDSIM_SOURCE_DATA}) {
    std::error_code failure;
    if (std::filesystem::is_directory(std::filesystem::path(folder) / "handmodels", failure)) return folder;
  }
  throw input_error("files installed with handsim", "no folder " HANDSIM_INSTALLED_DATA,
                    "an installed handsim, or the paths of the files");
}

}  // namespace handsim
