#include "handsim/app/completion.h"

#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

namespace handsim::app {

namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

struct OptionWords {
  std::string name;                  ///< `--side`
  std::vector<std::string> choices;  ///< of an option with a type such as `right|left|both`
  std::string help;
  bool takes_value = false;
};

std::vector<OptionWords> options_of(const CLI::App& command) {
  std::vector<OptionWords> out;
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_lnames().empty()) continue;
    OptionWords words{"--" + option->get_lnames().front(),
                      {},
                      option->get_description(),
                      option->get_items_expected_max() > 0};
    if (const std::string type = option->get_type_name(); type.find('|') != std::string::npos)
      words.choices = CLI::detail::split(type, '|');
    out.push_back(std::move(words));
  }
  return out;
}

std::string names(const std::vector<const CLI::App*>& commands) {
  std::vector<std::string> out;
  for (const CLI::App* command : commands) out.push_back(command->get_name());
  return fmt::format("{}", fmt::join(out, " "));
}

/// The script for bash; zsh runs it with bashcompinit.
std::string bash_script(const CLI::App& app) {
  const auto commands = commands_of(app);
  std::string options, choices;
  for (const CLI::App* command : commands) {
    std::string line;
    for (const OptionWords& option : options_of(*command)) {
      line += (line.empty() ? "" : " ") + option.name;
      if (!option.choices.empty())
        choices += fmt::format("    '{} {}') words='{}' ;;\n", command->get_name(), option.name,
                               fmt::join(option.choices, " "));
    }
    options += fmt::format("    {}) options='{}' ;;\n", command->get_name(), line);
  }
  return fmt::format(R"(_handsim() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} options='' words=''
  COMPREPLY=()
  if [[ $COMP_CWORD -eq 1 ]]; then
    COMPREPLY=($(compgen -W '{} --help --version' -- "$word"))
    return
  fi
  case ${{COMP_WORDS[1]}} in
{}  esac
  case "${{COMP_WORDS[1]}} $before" in
{}  esac
  if [[ -n $words ]]; then
    COMPREPLY=($(compgen -W "$words" -- "$word"))
  elif [[ $word == -* ]]; then
    COMPREPLY=($(compgen -W "$options" -- "$word"))
  fi
}}
complete -o default -F _handsim handsim
)",
                     names(commands), options, choices);
}

/// A text in single quotes for fish.
std::string fish_quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') out += '\\';
    out += c;
  }
  return out + "'";
}

std::string fish_script(const CLI::App& app) {
  const auto commands = commands_of(app);
  const std::string all = names(commands);
  std::string out;
  for (const CLI::App* command : commands) {
    out += fmt::format("complete -c handsim -n 'not __fish_seen_subcommand_from {}' -f -a {} -d {}\n", all,
                       command->get_name(), fish_quoted(command->get_description()));
    for (const OptionWords& option : options_of(*command))
      out += fmt::format(
          "complete -c handsim -n '__fish_seen_subcommand_from {}' -l {}{}{} -d {}\n", command->get_name(),
          option.name.substr(2), option.takes_value ? " -r" : "",
          option.choices.empty() ? "" : fmt::format(" -f -a '{}'", fmt::join(option.choices, " ")),
          fish_quoted(option.help));
  }
  return out;
}

/// Escapes a text for roff: no line begins with a control character, and hyphens are minus signs.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n'))
      out += std::string("\\&") + c;
    else
      out += c;
  }
  return out;
}

}  // namespace

std::string completion_script(const CLI::App& app, const std::string& shell) {
  if (shell == "fish") return fish_script(app);
  if (shell == "zsh")
    return "#compdef handsim\nautoload -U +X bashcompinit && bashcompinit\n" + bash_script(app);
  return bash_script(app);
}

std::string man_page(const CLI::App& app, const std::string& version) {
  std::string out = fmt::format(".TH HANDSIM 1 \"\" \"handsim {}\"\n.SH NAME\n{}\n", version,
                                roff("handsim - hands of a given person in a physics engine"));
  out += ".SH SYNOPSIS\n.B handsim\nCOMMAND [OPTIONS]\n.SH DESCRIPTION\n" + roff(app.get_description()) +
         ".\n" + roff(app.get_footer()) + "\n.SH COMMANDS\n";
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
