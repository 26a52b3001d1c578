#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "handsim/app/command_line.h"
#include "handsim/app/commands.h"
#include "handsim/core/error.h"
#include "handsim/core/text.h"

namespace handsim::app {

namespace {

/// The hard cases are a program of the tests.
constexpr const char* kHardCases = "stability";

struct OtherCommand {
  const char *name, *help, *example;
  const char* place;  ///< what completion offers in place of an option: `scene`, `study` or nothing
  /// The options' long names, with blanks between; after a sign what completion offers for their values:
  /// words, a folder of shipped files, or `$`: what `handsim COMMAND --NAMEs` prints.
  const char* options;
};
/// All but the hard cases are the Python package's; python/handsim/__main__.py has their modules.
constexpr std::array<OtherCommand, 17> kOtherCommands = {
    {{"accuracy", "Errors and CPU times of methods and steps, as table, CSV, JSON and plots",
      "handsim accuracy config/accuracy_slider_crank.yaml --out out/accuracy --target 1e-3", "study",
      "out report target"},
     {"compare", "Compare two hands or scenes: strength, forces of fingertips, workspace of the thumb",
      "handsim compare healthy.yaml blocked.yaml --out out/compared", "scene", "out set"},
     {"effects",
      "CPU time and influence of each effect of a scene: table, CSV, JSON and a plot of the scene without "
      "each "
      "effect in turn",
      "handsim effects config/dropped_hand.yaml --out out/effects --set duration=\"1 s\"", "scene",
      "out set engine repeats report json"},
     {"export",
      "A scene's model or motion, a finished run, or a person's hands, as a file for other programs, by "
      "--format",
      "handsim export --stature 1.75 --mass 72 --sex male --side right --out right.osim", "scene",
      "out format=$ time hands=skin|shapes|both fps set engine=ode|dae|articulated|auto "
      "person=config/persons "
      "stature mass sex=male|female|unknown age hand-length hand-breadth hand-circumference hand-mass "
      "hand-length-percentile model=handmodels side=right|left|both mount=fixed|hinge|universal|free muscles "
      "suite quiet"},
     {"grasp",
      "Run grasp and climb scenes: table of what was held, how firmly, the least friction that holds, and "
      "the "
      "load that a hand carried on a hold",
      "handsim grasp config --out out/grasps --side both", "scene",
      "out side=right|left|both persons=config/persons set engine friction friction-search margin confirm "
      "uncertain on report pictures video fps speed gl=osmesa|egl"},
     {"hand", "Hands of a person: dimensions, masses, joints; with --out also YAML and a picture",
      "handsim hand --stature 1.75 --mass 72 --sex male --side both --out out/hand", "",
      "stature mass sex=male|female|unknown age hand-length hand-breadth hand-circumference hand-mass "
      "hand-length-percentile person=config/persons model=handmodels side=right|left|both uncertain "
      "population percentile out"},
     {"identify", "Fit numbers of a scene to a recording, with intervals",
      "handsim identify out/run --scene grasp_pinch --free objects.0.mass", "",
      "scene free columns deviation set out json"},
     {"inverse",
      "Inverse dynamics: the torques about every axis that make a motion, and a simulation with them as a "
      "check",
      "handsim inverse config/every_pose.yaml --motion out/every/trajectory.mot --out out/inverse", "scene",
      "motion out names=controllers clamp cutoff loads no-check muscles co-contraction apart set engine json "
      "uncertain on report"},
     {"live", "Run a scene in real time in a browser, and take hold of it", "handsim live two_hands", "scene",
      "set engine port address play no-browser record stream replay measure seconds"},
     {"object", "Make an object of a mesh in STL, OBJ, PLY or glTF: convex hulls, mass and inertia",
      "handsim object handle.stl --unit mm --mass 200g --out handle.yaml", "",
      "unit=um|mm|cm|m|in mass density error hulls fill drop largest material=foam|metal|plastic|wood "
      "friction color sizes out json"},
     {"optimise", "Find torques, targets or excitations that reach a goal at least cost",
      "handsim optimise reach --goal reach --out out/reach", "scene", "goal out set iterations no-run quiet"},
     {"report", "One HTML page of a finished run or study, or of two runs in comparison",
      "handsim report out/two_hands", "", "out"},
     {"rollouts",
      "Thousands of runs of a scene, each with its own person, mass, friction or pose, on all cores or on "
      "many "
      "machines: one table, what makes them held, a plot",
      "handsim rollouts config/rollouts_power_can.yaml --out out/power_can --count 100", "study",
      "out set engine count seed jobs on resume range report"},
     {kHardCases, "Hard cases: every engine, method and step against an oracle; in a build of the source",
      "handsim stability config/stability.yaml --out out/stability --quick", "study", ""},
     {"track",
      "Inverse kinematics: joint angles and wrist poses of recorded hands, from 21 keypoints, markers or the "
      "sensors of a glove, and the measured hand of the person",
      "handsim track keypoints.csv --out out/tracked", "",
      "out person model markers points up handedness keep-person activations no-smoothing noise seed truth "
      "json names convention-from object=config/objects mass support=table|post|none friction muscles "
      "uncertain replay"},
     {"validate", "The hand against measurements: moment arms, forces, moments, masses beside their sources",
      "handsim validate --out out/validate", "", "out runs uncertain on report"},
     {"view", "Simulate a scene in a temporary folder and show its report in the browser",
      "handsim view config/two_hands.yaml", "scene", "set engine no-browser"}}};

/// The package stands beside the program of a build, or below the prefix of an installation, or where Python
/// finds it. An interpreter that has no package or no NumPy goes on to the next one.
constexpr const char* kStart = R"py(import os, sys
start, own, tried, other = sys.argv[1:5]
del sys.argv[1:5]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices
before = os.environ.get("PYTHONPATH", "")
sys.path[0:1] = [own + "/../python", own + "/../lib/python3/dist-packages"]
os.environ["PYTHONPATH"] = os.pathsep.join([*sys.path[:2], before]).rstrip(os.pathsep)
try:
    from handsim.__main__ import main
except ImportError as error:
    unbuilt = "'_core' from partially" in str(error)
    reason = "the package's module is not built" if unbuilt else error.__cause__ or error
    tried += (", " if tried else "") + f"{sys.executable} ({reason})"
    if other:
        os.environ["PYTHONPATH"] = before
        try:
            os.execvp(other, [other, "-c", start, start, own, tried, "", *sys.argv[1:]])
        except OSError as failure:
            tried += f", {other} ({failure.strerror})"
    print(f"handsim {sys.argv[1]}: got no Python package handsim (tried {tried}), need it and NumPy for this command: "
          "pip install handsim, or ./dev python in its source", file=sys.stderr)
    sys.exit(2)
sys.argv[0] = "handsim"
sys.exit(main()))py";

/// True where a command of this program is the package's: what writes the page of a run.
bool is_for_package(std::string_view command, std::string_view argument) {
  return command == "run" && argument.substr(0, argument.find('=')) == "--report";
}

/// The interpreter that the package was built for, then the path's; or HANDSIM_PYTHON, parted by colons.
std::vector<std::string> interpreters() {
  const char* own = std::getenv("HANDSIM_PYTHON");
  std::istringstream words(own && *own ? own : HANDSIM_PYTHON_PROGRAM ":python3");
  std::vector<std::string> out;
  for (std::string word; std::getline(words, word, ':');)
    if (!word.empty()) out.push_back(word);
  return out;
}

}  // namespace

bool is_other_command(int argc, const char* const* argv) {
  if (argc < 2) return false;
  const std::string_view name = argv[1];
  return std::ranges::find(kOtherCommands, name, &OtherCommand::name) != kOtherCommands.end() ||
         std::any_of(argv + 2, argv + argc,
                     [&](const char* argument) { return is_for_package(name, argument); });
}

void run_other_command(int argc, const char* const* argv) {
  const std::string folder = own_folder().string();
  std::vector<const char*> words(argv + 1, argv + argc);
  words.push_back(nullptr);
  const auto become = [&](const std::string& program, std::initializer_list<const char*> first) {
    std::vector<const char*> all = first;
    all.insert(all.end(), words.begin(), words.end());
    ::execvp(program.c_str(), const_cast<char* const*>(all.data()));
  };
  if (argv[1] == std::string_view(kHardCases)) {
    // Beside the program or the Python module of a build.
    become(folder + "/../tests/handsim-stability", {"handsim"});
    become(folder + "/../../tests/handsim-stability", {"handsim"});
    throw input_error(kHardCases, "a handsim without its tests",
                      "a build of the source: ./dev build, then its handsim stability");
  }
  const std::vector<std::string> pythons = interpreters();
  std::string tried;
  for (std::size_t i = 0; i < pythons.size(); ++i) {
    const std::string next = i + 1 < pythons.size() ? pythons[i + 1] : "";
    become(pythons[i],
           {pythons[i].c_str(), "-c", kStart, kStart, folder.c_str(), tried.c_str(), next.c_str()});
    tried += fmt::format("{}{} ({})", tried.empty() ? "" : ", ", pythons[i], std::strerror(errno));
  }
  throw input_error("python3", "no program that starts: " + tried,
                    "Python 3, in which this command is written");
}

void run_drawn(const study::Json& job) {
  const std::string text = job.dump();
  run_other_command(4, std::array<const char*, 4>{"handsim", "rollouts", "--job", text.c_str()}.data());
}

void add_other_commands(CommandLine& line) {
  for (const OtherCommand& command : kOtherCommands) {
    CLI::App& sub = *line.app.add_subcommand(command.name, command.help);
    sub.footer(std::string("Example: ") + command.example);
    if (*command.place) add_input(sub, command.place, line.unread, "file");
    for (const std::string_view option : split(command.options, ' ')) {
      const std::string name = "--" + std::string(option.substr(0, option.find('=')));
      const std::string words(option.substr(std::min(option.size(), option.find('=') + 1)));
      if (option.empty()) continue;
      if (name.size() == option.size() + 2)
        sub.add_flag(name);
      else if (words == "$")
        sub.add_option(name, line.unread)->type_name(fmt::format("$(handsim {} {}s)", command.name, name));
      else if (words.find('|') != std::string::npos)
        sub.add_option(name, line.unread)->type_name(words);
      else
        add_input(sub, name, line.unread, "file", words);
    }
  }
}

}  // namespace handsim::app
