#include "handsim/app/command_line.h"

#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

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

/// Calls `use` with each option that has a long name, and its words, of a type such as `right|left|both`.
template <class Use>
void each_option(const CLI::App& command, const Use& use) {
  for (const CLI::Option* option : command.get_options()) {
    if (option->get_lnames().empty()) continue;
    const std::vector<std::string> words = CLI::detail::split(option->get_type_name(), '|');
    use(*option, option->get_lnames().front(),
        words.size() > 1 ? fmt::format("{}", fmt::join(words, " ")) : "");
  }
}

/// The script for bash; zsh runs it with bashcompinit.
std::string bash_script(const CLI::App& app) {
  std::string cases;
  for (const CLI::App* command : commands_of(app)) {
    std::string options;
    each_option(*command, [&](const CLI::Option&, const std::string& name, const std::string& words) {
      options += "--" + name + " ";
      if (!words.empty())
        cases += fmt::format("    '{} --{}') words='{}' ;;\n", command->get_name(), name, words);
    });
    cases += fmt::format("    '{} '*) [[ $word == -* ]] && words='{}' ;;\n", command->get_name(), options);
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
