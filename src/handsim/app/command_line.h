// How commands register their options: helpers around CLI11, and the functions that register them.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "handsim/app/commands.h"
#include "handsim/core/data_folder.h"
#include "handsim/core/units.h"
#include "handsim/simulation/run/film.h"

namespace handsim::app {

/// The command line and the functions of its commands.
struct CommandLine {
  CLI::App app{"handsim: biomechanical hands of a given person, simulated with the Open Dynamics Engine"};
  std::vector<std::pair<CLI::App*, std::function<int()>>> commands;
  WritePage page;
  std::string unread;  ///< of commands of other programs, which are never parsed here

  /// @param arguments filled in when the command line is parsed.
  template <class Arguments>
  CLI::App& add(const char* name, const char* help, const char* example, int (*call)(const Arguments&),
                const std::shared_ptr<Arguments>& arguments) {
    CLI::App* command = app.add_subcommand(name, help);
    command->footer(std::string("Example: ") + example);
    commands.emplace_back(command, [call, arguments] { return call(*arguments); });
    return *command;
  }
};

/// A problem of usage in the form of all others.
std::string got_need(const std::string& got, const std::string& need);

using Check = std::function<std::string(const std::string&)>;
Check number_from(double least, double most, bool whole, const std::string& need);
std::string check_path(const std::string& text);

/// Restricts an option to words. @param bars the words with | between them, also for help and completion.
void add_words(CLI::Option* option, const std::string& bars);

/// Adds an option whose text `parse` reads; it returns nothing for an invalid text.
template <class Target, class Parse>
void add_parsed(CLI::App& command, const std::string& name, Target& target, Parse parse,
                const std::string& need, const std::string& help) {
  command.add_option_function<std::string>(
      name,
      [name, &target, parse, need](const std::string& text) {
        const auto value = parse(text);
        if (!value) throw CLI::ValidationError(name, got_need(text, need));
        target = *value;
      },
      help);
}

template <class Target>
void add_time(CLI::App& command, const std::string& name, Target& target, const std::string& help) {
  const auto parse = [](const std::string& text) {
    const auto value = parse_quantity(text, Dimension::time);
    return value && *value >= 0 ? value : std::nullopt;
  };
  add_parsed(command, name, target, parse, "a time from 0, such as 0.2 or \"200 ms\"", help);
}

inline const std::string kShippedMark = "shipped:";

/// Adds the path of an input, or the name of one shipped in `folder`, see find_input().
template <class Target>
CLI::Option* add_input(CLI::App& command, const std::string& name, Target& target, const std::string& help,
                       const std::string& folder = "config") {
  const auto find = [folder](std::string& text) {
    text = find_input(text, folder).string();
    return std::string();
  };
  // The name tells completion_script() what to offer.
  return command.add_option(name, target, help + ", or the name of a shipped one")
      ->transform(CLI::Validator(find, "", kShippedMark + folder));
}

/// `out/two_hands`, with the ending, for the command's first input two_hands.yaml; without an input or with
/// several, `out/COMMAND`. Commands beside `run` on a scene add their name: `out/two_hands_effects`.
std::filesystem::path default_out(const CLI::App& command, const std::string& ending = "");

/// Adds `--out` of a folder, by default default_out().
void add_out(CLI::App& command, std::filesystem::path& out, const std::string& help);

/// Adds `--set`, and `--engine` for `--set solver.engine=...`.
void add_overrides(CLI::App& app, std::vector<std::string>& overrides);

/// Adds `--uncertain`, a number of drawn hands, and `--on` for their runs.
template <class Arguments>
CLI::Option* add_uncertain_runs(CLI::App& command, Arguments& arguments) {
  CLI::Option* uncertain =
      command
          .add_option(
              "--uncertain", arguments.uncertain,
              "draw as many hands within what is uncertain of them: all figures with intervals, and which "
              "inputs own their variance")
          ->check(number_from(2, 1e6, true, "a whole number of hands, from 2"));
  command.add_option("--on", arguments.on, "dask://HOST:PORT of a scheduler whose workers run these hands")
      ->needs(uncertain);
  return uncertain;
}

/// Adds `--video` with its `--fps` and `--speed`, and `--gl`. @param where the video is written.
void add_drawing(CLI::App& command, std::optional<simulation::VideoSpec>& video,
                 std::optional<output::Gl>& gl, const std::string& where);

/// A script that completes commands, options and their words. @param shell bash, zsh or fish.
std::string completion_script(const CLI::App& app, const std::string& shell);
/// handsim(1) in the man macros of roff.
std::string man_page(const CLI::App& app, const std::string& version);

void add_scene_commands(CommandLine& line);
/// Adds the commands of other programs, for help and completion alone: these never reach CLI11.
void add_other_commands(CommandLine& line);

/// True for a command of the Python package or of the tests, and for the page of a run.
bool is_other_command(int argc, const char* const* argv);
/// Becomes the program of the command. @throws Error (input) without it
[[noreturn]] void run_other_command(int argc, const char* const* argv);

}  // namespace handsim::app
