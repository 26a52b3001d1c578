// Two pieces of work timed in turns, so that a noisy machine slows both: the benchmark reports the median of
// their ratios beside the median times.
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <vector>

namespace handsim::bench {

inline double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

template <class Work>
double seconds(Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Runs `prepare_*` untimed and `yardstick` and `candidate` timed, in turns; counters: ratio (candidate over
/// yardstick), and the time of one of `units` (e.g. steps) of each [us].
template <class Prepare, class Yardstick, class Candidate>
void compare(benchmark::State& state, double units, Prepare prepare, Yardstick yardstick,
             Candidate candidate) {
  std::vector<double> ratios, first, second;
  prepare();
  yardstick();
  prepare();
  candidate();
  for (auto unused : state) {
    (void)unused;
    prepare();
    first.push_back(seconds(yardstick));
    prepare();
    second.push_back(seconds(candidate));
    state.SetIterationTime(second.back());
    ratios.push_back(second.back() / first.back());
  }
  state.counters["ratio"] = median(ratios);
  state.counters["yardstick_us"] = 1e6 * median(first) / units;
  state.counters["candidate_us"] = 1e6 * median(second) / units;
}

}  // namespace handsim::bench
