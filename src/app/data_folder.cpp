#include "handsim/app/commands.h"
#include "handsim/core/error.h"

namespace handsim::app {

std::filesystem::path data_folder() {
  for (const char* folder : {HANDSIM_INSTALLED_DATA, HANDSIM_SOURCE_DATA}) {
    std::error_code failure;
    if (std::filesystem::is_directory(std::filesystem::path(folder) / "handmodels", failure)) return folder;
  }
  throw input_error("--model", "nothing, and no shipped hand model at " HANDSIM_INSTALLED_DATA,
                    "the path of a hand model");
}

std::string ending_of(const std::filesystem::path& path) {
  std::string out = path.extension().string();
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}

}  // namespace handsim::app
