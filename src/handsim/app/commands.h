// The command line: subcommands that read files, call the library and print. Exit status 0: done, criteria
// held; 1: a criterion failed, the simulation diverged, or output was lost; 2: bad input or usage.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "handsim/app/console.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/simulation/run/run.h"
#include "handsim/study/report.h"
#include "handsim/study/rollouts/rollouts.h"

namespace handsim::app {

struct CommandLine;
using MoreCommands = void (*)(CommandLine& line);
/// Writes report.html into the folder of a finished run, and returns what hindered it: nothing, if it did.
/// The Python package has it (python/handsim/_run_page.py).
using WritePage = std::function<std::string(const std::filesystem::path& folder)>;
/// @param more registers the commands of another program that is handsim with them; null: none
/// @param page empty: a program without Python, which becomes the package's for a command with a page of a
/// run
int run_command_line(int argc, const char* const* argv, MoreCommands more = nullptr,
                     const WritePage& page = {});

/// Reads a file of a known kind. @throws Error (input) with all its problems.
template <class Read>
auto load_kind(const std::filesystem::path& path, scene::FileKind kind, const Read& read) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  decltype(read(root, "", diagnostics)) out{};
  if (scene::is_of_kind(root, "", kind, diagnostics)) out = read(root, "", diagnostics);
  diagnostics.throw_if_any();
  print_warnings(diagnostics.warnings);
  return out;
}

/// Whose hands, without a scene.
struct HandArguments {
  std::optional<std::filesystem::path> person;  ///< a file, instead of measures
  std::map<std::string, std::string> measures;  ///< by key of a person file
  std::optional<std::filesystem::path> model;   ///< absent: the installed anatomical hand
  std::string side;
};

/// The person and the hand model that a command's options name.
struct PersonHands {
  hand::HandSpec model;
  hand::Person person;
  YamlNode files = yaml_map();  ///< trees of both files
  std::vector<std::string> warnings;
};

/// @throws Error (input) that names the files' keys or the options.
PersonHands read_person_hands(const HandArguments& arguments);

/// A scene with the requested hands: straight, side by side, backs up.
scene::Scene compile_hands(const std::string& side, hand::Mount mount, const model::Effects& effects,
                           PersonHands input);

struct CheckArguments {
  std::vector<std::filesystem::path> files;
  bool engines = false;  ///< prints which engines can run each scene instead of checking
};
int check_command(const CheckArguments& arguments);

struct SchemaArguments {
  std::string kind;  ///< word of a FileReader
};
int schema_command(const SchemaArguments& arguments);

struct RunArguments : simulation::RunOptions {
  std::filesystem::path scene;
  std::vector<std::string> overrides;
  std::optional<int> rollout;    ///< of the study that stands in the scene's place
  std::optional<int> uncertain;  ///< draws of the scene's hands
  std::string on;                ///< address of the Dask scheduler that runs these; empty: this machine
  std::optional<int> seed;       ///< in place of the study's
  bool report = false;           ///< writes report.html
  WritePage page;
  bool passing = false;  ///< the folder is removed afterwards: nothing names it
  bool quiet = false;
  bool json = false;
};
int run_scene_command(const RunArguments& arguments);

struct RenderArguments {
  std::filesystem::path scene;
  std::optional<std::filesystem::path> out;  ///< of the picture; absent: only the video
  std::vector<std::string> overrides;
  std::optional<double> time;  ///< [s]; absent: the start, of a video the scene's end
  std::optional<simulation::VideoSpec> video;
  std::optional<output::Gl> gl;  ///< absent: the default of this build
};
int render_command(const RenderArguments& arguments);

/// Becomes the package's `handsim rollouts`, which draws uncertain hands for other commands, too.
/// @param job what Job of python/handsim/_rollouts_command.py has. @throws Error (input) without the package
[[noreturn]] void run_drawn(const study::Json& job);

/// A line for each of the ten deepest overlaps of shapes at the start, deepest first, and how many others.
std::vector<std::string> overlap_texts(const model::Model& model, std::vector<engine::Overlap> overlaps);

/// Sets what the page of a run shows beside its poses: contacts, where an effect of contact is on.
void record_contacts(scene::Scene& scene);

/// A reader of YAML files, for `handsim check` and `handsim schema`.
struct FileReader {
  std::string_view word;  ///< of the command line
  scene::FileKind kind;
  void (*read)(const YamlNode& root, Diagnostics& diagnostics);
};

std::span<const FileReader> file_readers();

}  // namespace handsim::app
