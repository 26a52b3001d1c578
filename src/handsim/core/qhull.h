// Qhull's state of one hull, freed with all that it holds. Only for sources that link Qhull.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <libqhull_r/qhull_ra.h>

namespace handsim {

struct FreeQhull {
  void operator()(qhT* state) const {
    qh_freeqhull(state, !qh_ALL);
    int long_blocks = 0, long_bytes = 0;
    qh_memfreeshort(state, &long_blocks, &long_bytes);
    delete state;
  }
};
using QhullState = std::unique_ptr<qhT, FreeQhull>;

/// The hull of points, given one after the other: the state points into them. Null where Qhull fails; its
/// messages are discarded.
inline QhullState run_qhull(std::vector<double>& coordinates, int dimension, std::string options) {
  QhullState state(new qhT{});
  qh_zero(state.get(), nullptr);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> silence(std::fopen("/dev/null", "w"), &std::fclose);
  const int failed = qh_new_qhull(state.get(), dimension, static_cast<int>(coordinates.size()) / dimension,
                                  coordinates.data(), False, options.data(), silence.get(), silence.get());
  return failed == 0 ? std::move(state) : nullptr;
}

}  // namespace handsim
