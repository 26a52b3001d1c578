#include "handsim/study/track/least_squares.h"

#include <dlfcn.h>

#include <filesystem>
#include <string>
#include <vector>

#include "handsim/core/error.h"

namespace handsim::study {

namespace {

constexpr const char* kModule = "handsim_ceres.so";
using Solve = void (*)(const LeastSquares*, double*);

/// Where the module may be: beside this program or Python module, in a folder of libraries of the same
/// installation, where it was installed, where it was built.
std::vector<std::filesystem::path> places() {
  std::vector<std::filesystem::path> out;
  static const int kHere = 0;
  Dl_info info{};
  if (dladdr(&kHere, &info) != 0 && info.dli_fname != nullptr) {
    std::error_code none;
    const auto own = std::filesystem::canonical(info.dli_fname, none).parent_path();
    out = {own, own / "../" HANDSIM_LIBRARIES "/handsim"};
  }
  out.insert(out.end(), {HANDSIM_INSTALLED_MODULES, HANDSIM_BUILT_MODULES});
  return out;
}

Solve load() {
  std::string why = "not found";
  for (const std::filesystem::path& folder : places()) {
    std::error_code none;
    if (!std::filesystem::exists(folder / kModule, none)) continue;
    void* const module = dlopen((folder / kModule).c_str(), RTLD_NOW | RTLD_LOCAL);
    if (module != nullptr)
      if (void* const found = dlsym(module, "handsim_least_squares")) return reinterpret_cast<Solve>(found);
    if (const char* text = dlerror()) why = text;
    break;
  }
  throw input_error(kModule, why,
                    "the module installed with handsim in " HANDSIM_INSTALLED_MODULES
                    ", and Ceres (Debian: libceres3)");
}

}  // namespace

void solve(const LeastSquares& problem, std::span<double> x) {
  static const Solve kSolve = load();
  kSolve(&problem, x.data());
}

}  // namespace handsim::study
