#include "handsim/simulation/mathematics.h"

#include <cmath>

#ifdef __GLIBC__
#include <gnu/libc-version.h>
#endif

#include <fmt/format.h>

#include "handsim/core/archive.h"
#include "handsim/simulation/watch/state_hash.h"

namespace handsim::simulation {

namespace {

/// Enough arguments that two ways of rounding differ at many of them, and some tens of microseconds.
constexpr int kArguments = 500;

std::uint64_t results() {
  ArchiveWriter out;
  // The compiler must not know the arguments: it would work out the results itself.
  volatile double step = 0.0137;
  for (int i = 1; i <= kArguments; ++i) {
    const double x = step * i, below_one = std::fmod(x, 1.0);
    for (const double value : {std::sin(x), std::cos(x), std::tan(x), std::exp(x), std::log(x),
                               std::pow(x, 1.3), std::atan2(x, 2.7), std::asin(below_one),
                               std::acos(below_one), std::hypot(x, 1.7), std::atan(x), std::exp(-x)})
      out(value);
  }
  return hash_bytes(out.bytes());
}

std::string library() {
#ifdef __GLIBC__
  return fmt::format("glibc {}", gnu_get_libc_version());
#else
  return "unknown library";
#endif
}

}  // namespace

const std::string& mathematics() {
  static const std::string text =
      fmt::format("{}, results {:08x}", library(), static_cast<std::uint32_t>(results()));
  return text;
}

}  // namespace handsim::simulation
