#include "handsim/app/command_line.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/text.h"
#include "handsim/core/yaml_files.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::app {

namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

std::string names_of(const CLI::App& app) {
  std::string out;
  for (const CLI::App* command : commands_of(app)) out += command->get_name() + " ";
  return out;
}

/// Names in config/, read once: of scenes, and of studies and all others.
const std::vector<std::string>& names_in_config(bool scenes) {
  static const std::array<std::vector<std::string>, 2> names = [] {
    std::array<std::vector<std::string>, 2> out;
    for (const std::string& name : shipped_names("config")) {
      if (name.find('/') != std::string::npos) continue;
      const YamlNode root = load_yaml(data_folder() / "config" / (name + ".yaml"));
      out[scene::kind_of(root) == scene::FileKind::scene ? 1 : 0].push_back(name);
    }
    return out;
  }();
  return names[scenes ? 1 : 0];
}

/// The names of shipped files that an option may have.
std::string shipped_words(const CLI::Option& option) {
  std::string folder;
  try {
    folder = const_cast<CLI::Option&>(option).get_validator(0)->get_name();
  } catch (const CLI::OptionNotFound&) {
    return {};
  }
  if (!folder.starts_with(kShippedMark)) return {};
  folder.erase(0, kShippedMark.size());
  const std::vector<std::string> names =
      folder == "config" ? names_in_config(option.get_name(true) != "study") : shipped_names(folder);
  return names.empty() ? "" : fmt::format("{} ", fmt::join(names, " "));
}

/// Calls `use` with each option that has a long name, and its words: of a type such as `right|left|both`,
/// what the shell makes of `$(...)`, or names of shipped files.
template <class Use>
void each_option(const CLI::App& command, const Use& use) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_lnames().empty()) continue;
    const std::string type = option->get_type_name();
    const std::vector<std::string> words = CLI::detail::split(type, '|');
    use(*option, option->get_lnames().front(),
        words.size() > 1 || type.starts_with('$') ? fmt::format("{}", fmt::join(words, " "))
                                                  : shipped_words(*option));
  }
}

/// The words in place of an option.
std::string place_words(const CLI::App& command) {
  for (const CLI::Option* option : command.get_options())
    if (option->get_positional()) return shipped_words(*option);
  return {};
}

/// The script for bash; zsh runs it with bashcompinit.
std::string bash_script(const CLI::App& app) {
  std::string cases;
  for (const CLI::App* command : commands_of(app)) {
    std::string options;
    each_option(*command, [&](const CLI::Option& option, const std::string& name, const std::string& words) {
      options += "--" + name + " ";
      if (option.get_items_expected_max() > 0)
        cases += fmt::format("    '{} --{}') words='{}' ;;\n", command->get_name(), name, words);
    });
    cases += fmt::format("    '{} '*) words='{}'; [[ $word == -* ]] && words='{}' ;;\n", command->get_name(),
                         place_words(*command), options);
  }
  return fmt::format(R"(_handsim() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} words=''
  case "${{COMP_WORDS[1]}} ${{COMP_WORDS[COMP_CWORD-1]}}" in
{}  esac
  [[ $COMP_CWORD -eq 1 ]] && words='{}--help --version'
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _handsim handsim
)",
                     cases, names_of(app));
}

/// The text with a mark before each of some characters.
std::string escaped(const std::string& text, std::string_view characters) {
  std::string out;
  for (const char c : text) (characters.find(c) < characters.size() ? out += '\\' : out) += c;
  return out;
}

std::string fish_script(const CLI::App& app) {
  std::string out;
  for (const CLI::App* command : commands_of(app)) {
    out += fmt::format("complete -c handsim -n 'not __fish_seen_subcommand_from {}' -f -a {} -d '{}'\n",
                       names_of(app), command->get_name(), escaped(command->get_description(), "'\\"));
    if (const std::string words = place_words(*command); !words.empty())
      out += fmt::format("complete -c handsim -n '__fish_seen_subcommand_from {}' -a '{}'\n",
                         command->get_name(), words);
    each_option(*command, [&](const CLI::Option& option, const std::string& name, const std::string& words) {
      out += fmt::format("complete -c handsim -n '__fish_seen_subcommand_from {}' -l {}{}{} -d '{}'\n",
                         command->get_name(), name, option.get_items_expected_max() > 0 ? " -r" : "",
                         words.empty() ? "" : " -f -a '" + words + "'",
                         escaped(option.get_description(), "'\\"));
    });
  }
  return out;
}

/// Escapes a text for roff: no line begins with a control character, and hyphens are minus signs.
std::string roff(const std::string& text) {
  std::string out;
  for (const std::string& line : CLI::detail::split(escaped(text, "-"), '\n'))
    out += (out.empty() ? "" : "\n") +
           std::string(line.starts_with('.') || line.starts_with('\'') ? "\\&" : "") + line;
  return out;
}

}  // namespace

std::string got_need(const std::string& got, const std::string& need) {
  return fmt::format("got {}, need {}", got, need);
}

void add_words(CLI::Option* option, const std::string& bars) {
  option->type_name(bars)->check([bars](const std::string& text) {
    const std::vector<std::string> words = CLI::detail::split(bars, '|');
    return std::ranges::find(words, text) != words.end() ? "" : got_need(text, need_word(text, words));
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

std::filesystem::path default_out(const CLI::App& command, const std::string& ending) {
  std::string name;
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional() || option->count() != 1) continue;
    name = std::filesystem::path(option->results().front()).stem().string();
    const bool run = command.get_name() == "run" || !ending.empty();
    if (option->get_name(true) == "scene" && !run) name += "_" + command.get_name();
  }
  const bool none = name.find_first_not_of('.') == std::string::npos;
  return std::filesystem::path("out") / ((none ? command.get_name() : name) + ending);
}

void add_out(CLI::App& command, std::filesystem::path& out, const std::string& help) {
  command.add_option("--out", out, help + " (default: out/NAME)")->check(check_path);
  command.parse_complete_callback([&command, &out] {
    if (out.empty()) out = default_out(command);
  });
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

std::string completion_script(const CLI::App& app, const std::string& shell) {
  if (shell == "fish") return fish_script(app);
  const std::string zsh = "#compdef handsim\nautoload -U +X bashcompinit && bashcompinit\n";
  return (shell == "zsh" ? zsh : "") + bash_script(app);
}

std::string man_page(const CLI::App& app, const std::string& version) {
  std::string out = fmt::format(
      ".TH HANDSIM 1 \"\" \"handsim {}\"\n.SH NAME\n{}\n.SH SYNOPSIS\n.B handsim\nCOMMAND [OPTIONS]\n"
      ".SH DESCRIPTION\n{}.\n{}\n.SH COMMANDS\n",
      version, roff("handsim - hands of a given person in a physics engine"), roff(app.get_description()),
      roff(app.get_footer()));
  for (const CLI::App* command : commands_of(app)) {
    out += fmt::format(".SS handsim {}\n{}.\n", roff(command->get_name()), roff(command->get_description()));
    for (const CLI::Option* option : command->get_options())
      out += fmt::format(".TP\n.B {}\n{}\n", roff(option->get_name(option->get_lnames().empty())),
                         roff(option->get_description()));
    if (!command->get_footer().empty()) out += ".PP\n" + roff(command->get_footer()) + "\n";
  }
  return out;
}

}  // namespace handsim::app
