#include "handsim/app/command_line.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/core/text.h"

namespace handsim::app {

std::string got_need(const std::string& got, const std::string& need) {
  return fmt::format("got {}, need {}", got, need);
}

void add_words(CLI::Option* option, const std::string& bars) {
  option->type_name(bars)->check([bars](const std::string& text) {
    const std::vector<std::string> words = CLI::detail::split(bars, '|');
    const bool known = std::find(words.begin(), words.end(), text) != words.end();
    return known ? "" : got_need(text, need_word(text, words));
  });
}

Check number_from(double least, double most, bool whole, const std::string& need) {
  return [=](const std::string& text) {
    const auto value = parse_number(text);
    const bool good = value && *value >= least && *value <= most && (!whole || *value == std::floor(*value));
    return good ? "" : got_need(text, need);
  };
}

std::string check_path(const std::string& text) { return text.empty() ? got_need("\"\"", "a path") : ""; }

void add_out(CLI::App& command, std::filesystem::path& out, const std::string& help) {
  command.add_option("--out", out, help)->required()->check(check_path);
}

void add_overrides(CLI::App& app, std::vector<std::string>& overrides) {
  const auto engine = std::make_shared<std::string>();
  add_words(
      app.add_option("--engine", *engine,
                     "replaces the scene's engine, with its default method; settings that it does not have "
                     "are left out"),
      "ode|dae|articulated|auto");
  // Before the others, which may then set keys of that engine.
  app.callback([engine, &overrides] {
    if (!engine->empty()) overrides.insert(overrides.begin(), "solver.engine=" + *engine);
  });
  app.add_option("--set", overrides, "override a key of the scene: solver.step=\"5 ms\"; may be repeated")
      ->allow_extra_args(false);  // by default CLI11 gives a repeatable option all words after it
}

}  // namespace handsim::app
