#include "handsim/app/commands.h"

#include <new>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/program.h"
#include "handsim/core/error.h"
#include "handsim/core/text.h"
#include "handsim/core/version.h"
#include "handsim/engine/articulated/kernels/kernels.h"

namespace handsim::app {

namespace {

constexpr int kBadInput = 2;
constexpr int kFailed = 1;

/// Calls a command. Prints an exception, without allocating memory, and returns its exit status.
template <class Command>
int guarded(Command command) {
  const auto failed = [](std::string_view head, const char* what, int status) {
    print_error_text(head);
    print_error_text(what);
    print_error_text("\n");
    return status;
  };
  try {
    return command();
  } catch (const Error& error) {
    return failed("", error.what(), error.kind() == ErrorKind::input ? kBadInput : kFailed);
  } catch (const std::bad_alloc&) {
    return failed("handsim: ", "out of memory", kFailed);
  } catch (const std::exception& error) {
    return failed("handsim: ", error.what(), kFailed);
  }
}

void add_completion(CommandLine& line) {
  const auto shell = std::make_shared<std::string>();
  CLI::App* command =
      line.app.add_subcommand("completion", "Print a completion script for a shell, or the man page");
  command->footer("Example: handsim completion bash > ~/.local/share/bash-completion/completions/handsim");
  add_words(command->add_option("shell", *shell, "bash, zsh, fish, or man for the man page")->required(),
            "bash|zsh|fish|man");
  line.commands.emplace_back(command, [&app = line.app, shell] {
    print_text(*shell == "man" ? man_page(app, kVersion) : completion_script(app, *shell));
    return 0;
  });
}

/// The error of a missing or unknown command; CLI11 reports both as missing.
Error command_error(const CLI::App& app, int argc, const char* const* argv) {
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    known.push_back(command->get_name());
  const std::string got = argc > 1 ? argv[1] : "nothing";
  return input_error("command", got, need_word(got, known));
}

/// The error of an unknown option or of an additional word; nothing for other problems.
std::optional<Error> option_error(const CLI::App& command) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  for (const std::string& word : command.remaining()) {
    if (word == "--") continue;
    if (!word.starts_with('-'))
      return input_error("arguments", "one too many, " + word,
                         "no more; put a value that contains a blank in quotes");
    const std::string option = word.substr(0, word.find('='));
    return input_error(option, "an unknown option", need_word(option, known));
  }
  return std::nullopt;
}

int parse_and_call(int argc, const char* const* argv, MoreCommands more, const WritePage& page) {
  if (!more && is_other_command(argc, argv)) run_other_command(argc, argv);
  CommandLine line;
  line.page = page;
  CLI::App& app = line.app;
  app.set_version_flag("--version",
                       fmt::format("handsim {}, commit {}\n{}\n{}\narticulated engine, {}", kVersion, kCommit,
                                   kCompiler, kOde, engine::articulated::kernels().back()->name));
  app.require_subcommand(1);
  app.footer(
      "Details: handsim COMMAND --help. Exit status: 0 done, all criteria held; 1 a criterion failed, the "
      "simulation diverged, or output was lost; 2 bad input.");
  add_scene_commands(line);
  (more ? more : add_other_commands)(line);
  add_completion(line);
  try {
    app.parse(argc, argv);
  } catch (const Error&) {
    // What is taken for the name of an input may be the value of a misspelt option.
    if (const std::optional<Error> unknown = option_error(*app.get_subcommands().front())) throw *unknown;
    throw;
  } catch (const CLI::ParseError& error) {
    // CLI11 has many codes; here usage problems have exit status 2.
    if (error.get_exit_code() != 0) {
      if (app.get_subcommands().empty()) throw command_error(app, argc, argv);
      if (const std::optional<Error> unknown = option_error(*app.get_subcommands().front())) throw *unknown;
      if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError))
        throw input_error("arguments", "too many words", "the words that --help shows");
    }
    std::ostringstream help, problem;
    const int status = app.exit(error, help, problem) == 0 ? 0 : kBadInput;
    print_text(help.str());
    print_error_text(problem.str());
    return status;
  }
  for (const auto& [command, call] : line.commands)
    if (command->parsed()) return call();
  return 0;
}

}  // namespace

int run_command_line(int argc, const char* const* argv, MoreCommands more, const WritePage& page) {
  return guarded([&] { return parse_and_call(argc, argv, more, page); });
}

int run_program(int argc, const char* const* argv) {
  prepare_streams();
  return finish_output(run_command_line(argc, argv));
}

}  // namespace handsim::app
