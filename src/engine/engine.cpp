#include "handsim/engine/engine.h"

#include <fmt/format.h>

namespace handsim::engine {

std::vector<Problem> defects(const Settings& settings) {
  std::vector<Problem> problems;
  const auto need = [&](bool good, const char* key, double value, const char* range) {
    if (!good)
      problems.push_back({std::nullopt, std::string("solver.") + key, fmt::format("{:g}", value), range});
  };
  // Written so that NaN fails.
  need(settings.step > 0 && settings.step <= kMaxStep, "step", settings.step, "above 0 s, at most 0.1 s");
  need(settings.erp >= 0 && settings.erp <= 1, "erp", settings.erp, "0 to 1");
  need(settings.cfm > 0 && settings.cfm <= 1, "cfm", settings.cfm, "above 0, at most 1");
  need(settings.iterations >= 1 && settings.iterations <= kMaxIterations, "iterations", settings.iterations,
       "1 to 100000");
  return problems;
}

}  // namespace handsim::engine
