#include "handsim/study/track/least_squares.h"

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "handsim/core/data_folder.h"
#include "handsim/core/error.h"

namespace handsim::study {

namespace {

constexpr const char* kModule = "handsim_ceres.so";
using Solve = void (*)(const LeastSquares*, double*);

/// Where the module may be: beside this program or Python module, in a folder of libraries of the same
/// installation, where it was installed, where it was built, where the Debian package has it.
std::vector<std::filesystem::path> places() {
  const std::filesystem::path own = own_folder();
  return {own, own / "../" HANDSIM_LIBRARIES "/handsim", HANDSIM_INSTALLED_MODULES, HANDSIM_BUILT_MODULES,
          "/usr/lib/handsim"};
}

Solve load() {
  std::string why = "not found";
  // OpenBLAS would start a thread for each core and reserve memory for it; the fits use one.
  setenv("OPENBLAS_NUM_THREADS", "1", 0);
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
