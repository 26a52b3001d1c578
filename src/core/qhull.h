// Qhull's state of one hull, freed with all that it holds. Only for sources that link Qhull.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <libqhull_r/qhull_ra.h>

namespace handsim {

struct QhullState : qhT {
  QhullState() : qhT{} { qh_zero(this, nullptr); }
  ~QhullState() {
    qh_freeqhull(this, !qh_ALL);
    int long_blocks = 0, long_bytes = 0;
    qh_memfreeshort(this, &long_blocks, &long_bytes);
  }
  QhullState(const QhullState&) = delete;
  QhullState& operator=(const QhullState&) = delete;
};

/// The hull of points, given one after the other: the state points into them. Null where Qhull fails; its
/// messages are discarded.
inline std::unique_ptr<QhullState> run_qhull(std::vector<double>& coordinates, int dimension,
                                             std::string options) {
  auto state = std::make_unique<QhullState>();
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> silence(std::fopen("/dev/null", "w"), &std::fclose);
  const int failed = qh_new_qhull(state.get(), dimension, static_cast<int>(coordinates.size()) / dimension,
                                  coordinates.data(), False, options.data(), silence.get(), silence.get());
  return failed == 0 ? std::move(state) : nullptr;
}

}  // namespace handsim
