// A progress bar for work of more than a second; a line every ten seconds if standard error is no terminal.
#pragma once

#include <unistd.h>

#include <array>
#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "handsim/app/console.h"
#include "handsim/study/study_run.h"

namespace handsim::app {

class ProgressBar {
 public:
  ProgressBar() = default;
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar() {
    if (drawn_) print_error_text("\r                                                                \r");
  }

  /// @param share of the work that is done, 0..1.
  void show(double share) {
    const auto now = std::chrono::steady_clock::now();
    if (!terminal_) return show_line(now, share);
    if (now - start_ < std::chrono::seconds(1) || now - shown_ < std::chrono::milliseconds(100)) return;
    shown_ = now;
    drawn_ = true;
    constexpr int kWidth = 40;
    const int full = static_cast<int>(share * kWidth);
    std::array<char, 100> text{};
    const auto end = fmt::format_to_n(text.data(), text.size(), "\r[{:#<{}}{:.<{}}] {:3.0f} %, {:>6} left",
                                      "", full, "", kWidth - full, 100 * share, left(now, share));
    print_error_text({text.data(), end.size});
  }

 private:
  void show_line(std::chrono::steady_clock::time_point now, double share) {
    const std::string rest = left(now, share);  // its clock starts with the first share
    if (now - shown_ < std::chrono::seconds(10)) return;
    shown_ = now;
    print_error("progress: {:.0f} %, {} left\n", 100 * share, rest);
  }

  /// `40 s`, `12 min`, `3.2 h`: at the speed since the first share; a resumed study has that from before.
  std::string left(std::chrono::steady_clock::time_point now, double share) {
    if (!first_) first_ = {now, share};
    const double gone = std::chrono::duration<double>(now - first_->first).count();
    if (gone < 1 || share <= first_->second) return "?";
    const double seconds = gone * (1 - share) / (share - first_->second);
    return seconds < 100    ? fmt::format("{:.0f} s", seconds)
           : seconds < 6000 ? fmt::format("{:.0f} min", seconds / 60)
                            : fmt::format("{:.3g} h", seconds / 3600);
  }

  std::optional<std::pair<std::chrono::steady_clock::time_point, double>> first_;
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::chrono::steady_clock::time_point shown_ = start_;
};

/// Calls a function with what shows the share done, and removes the bar at its end.
template <class Run>
auto with_progress(const Run& run) {
  ProgressBar bar;
  return run([&bar](double share) { bar.show(share); });
}

/// Runs a study with a progress bar and prints its end.
template <class Study>
int with_bar(const study::StudyRun& asked, const Study& study) {
  std::optional<ProgressBar> bar(std::in_place);
  study::StudyRun run = asked;
  run.progress = [&bar](double share) { bar->show(share); };
  run.tell = [&bar](const std::string& text) {
    bar.reset();
    print_text(text);
  };
  const study::StudyEnd end = study(run);
  bar.reset();
  return print_study(end, asked.out);
}

}  // namespace handsim::app
