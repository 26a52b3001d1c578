#include "handsim/control/filter.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "handsim/model/spline.h"

namespace handsim::control {

namespace {

/// Coefficients of y = b (x + 2 x1 + x2) - a1 y1 - a2 y2, by the bilinear transform.
struct Section {
  double b = 1, a1 = 0, a2 = 0;

  Section(double step, double cutoff) {
    // Two passes at a higher cut-off have 1/sqrt(2) together at the given one (Winter 2009, 2.2.4.4).
    const double both = std::pow(std::sqrt(2.0) - 1, 0.25);
    const double k = std::tan(M_PI * cutoff * step) / both;
    const double scale = 1 + std::sqrt(2.0) * k + k * k;
    b = k * k / scale;
    a1 = 2 * (k * k - 1) / scale;
    a2 = (1 - std::sqrt(2.0) * k + k * k) / scale;
  }

  /// Starts as if the first value had lasted for ever.
  void run(std::vector<double>& x) const {
    double x1 = x.front(), x2 = x1, y1 = x1, y2 = x1;
    for (double& value : x) {
      const double y = b * (value + 2 * x1 + x2) - a1 * y1 - a2 * y2;
      x2 = x1;
      x1 = value;
      y2 = y1;
      y1 = value = y;
    }
  }
};

}  // namespace

void low_pass(std::vector<double>& values, double step, double cutoff) {
  assert(cutoff > 0 && cutoff * step < 0.5);
  const std::size_t n = values.size();
  if (n < 2) return;
  const Section section(step, cutoff);
  // The filter's memory is some periods of its cut-off.
  const std::size_t most = n - 1, wanted = static_cast<std::size_t>(std::ceil(3 / (cutoff * step)));
  const std::size_t pad = std::min(most, wanted);
  std::vector<double> x;
  x.reserve(n + 2 * pad);
  for (std::size_t i = pad; i > 0; --i) x.push_back(2 * values.front() - values[i]);
  x.insert(x.end(), values.begin(), values.end());
  for (std::size_t i = 1; i <= pad; ++i) x.push_back(2 * values.back() - values[n - 1 - i]);
  section.run(x);
  std::reverse(x.begin(), x.end());
  section.run(x);
  std::reverse(x.begin(), x.end());
  std::copy_n(x.begin() + static_cast<std::ptrdiff_t>(pad), n, values.begin());
}

bool low_pass_rows(std::vector<double>& times, std::vector<double>& values, std::size_t width,
                   double cutoff) {
  const std::size_t n = times.size();
  if (n < 2) return true;
  const double step = (times.back() - times.front()) / static_cast<double>(n - 1);
  if (!(cutoff * step < 0.5)) return false;
  const model::CubicSpline recorded(times, values, width);
  for (std::size_t r = 0; r < n; ++r) {
    times[r] = r + 1 == n ? times.back() : times.front() + static_cast<double>(r) * step;
    recorded.at(times[r], std::span(values).subspan(r * width, width));
  }
  std::vector<double> column(n);
  for (std::size_t c = 0; c < width; ++c) {
    for (std::size_t r = 0; r < n; ++r) column[r] = values[r * width + c];
    low_pass(column, step, cutoff);
    for (std::size_t r = 0; r < n; ++r) values[r * width + c] = column[r];
  }
  return true;
}

}  // namespace handsim::control
