#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/core/error.h"

namespace handsim::app {

namespace {

struct PythonCommand {
  const char *name, *help, *example;
};
/// Commands of the Python package; python/handsim/__main__.py has their modules.
constexpr std::array<PythonCommand, 2> kPythonCommands = {
    {{"compare", "Compare two hands or scenes: strength, forces of fingertips, workspace of the thumb",
      "handsim compare healthy.yaml blocked.yaml --out out/compared"},
     {"live", "Run a scene in real time in a browser, and take hold of it", "handsim live two_hands"}}};

/// Formats of `export` that the package writes.
constexpr std::array<std::string_view, 4> kPythonFormats = {"glb", "usda", "obj", "stl"};

/// The package stands beside the program of a build, or below the prefix of an installation, or where Python
/// finds it.
constexpr const char* kStart = R"(import sys
own = sys.argv.pop(1)
sys.path[0:1] = [own + "/../python", own + "/../lib/python3/dist-packages"]
try:
    from handsim.__main__ import main
except ImportError as error:
    print(f"handsim {sys.argv[1]}: got no Python package handsim ({error}), need it and NumPy for this command: "
          "pip install handsim, or ./dev python in its source", file=sys.stderr)
    sys.exit(2)
sys.argv[0] = "handsim"
sys.exit(main()))";

/// True for `glb`, `--format=glb` and `out/hand.glb`.
bool names_format(std::string_view argument) {
  argument.remove_prefix(argument.find_last_of(".=") + 1);
  return std::ranges::find(kPythonFormats, argument) != kPythonFormats.end();
}

}  // namespace

bool is_python_command(int argc, const char* const* argv) {
  if (argc < 2) return false;
  const std::string_view name = argv[1];
  return std::ranges::any_of(kPythonCommands,
                             [&](const PythonCommand& command) { return name == command.name; }) ||
         (name == "export" && std::any_of(argv + 2, argv + argc, names_format));
}

void run_python_command(int argc, const char* const* argv) {
  const std::string folder = own_folder().string();
  std::vector<const char*> words = {"python3", "-c", kStart, folder.c_str()};
  words.insert(words.end(), argv + 1, argv + argc);
  words.push_back(nullptr);
  ::execvp(words.front(), const_cast<char* const*>(words.data()));
  throw input_error("python3", "no program of this name", "Python 3, in which this command is written");
}

void add_python_commands(CommandLine& line) {
  for (const PythonCommand& command : kPythonCommands)
    line.app.add_subcommand(command.name, command.help)->footer(std::string("Example: ") + command.example);
}

}  // namespace handsim::app
