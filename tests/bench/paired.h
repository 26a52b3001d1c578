// Two pieces of work timed in turns, so that a noisy machine slows both: the benchmark reports the median of
// their ratios beside the median times.
#pragma once

#include <benchmark/benchmark.h>
#include <time.h>

#include <algorithm>
#include <vector>

namespace handsim::bench {

inline constexpr int kSteps = 2000;  ///< of a repetition

inline double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

/// CPU time of this thread, which other programs do not take from it [s].
inline double cpu_now() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <class Work>
double seconds(Work& work) {
  const double start = cpu_now();
  work();
  return cpu_now() - start;
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
    // Of both: where the yardstick is a thousand times as slow, the library would ask for hundreds of turns.
    state.SetIterationTime(first.back() + second.back());
    ratios.push_back(second.back() / first.back());
  }
  state.counters["ratio"] = median(ratios);
  state.counters["yardstick_us"] = 1e6 * median(first) / units;
  state.counters["candidate_us"] = 1e6 * median(second) / units;
}

}  // namespace handsim::bench
