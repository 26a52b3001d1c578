// The command line: subcommands that read files, call the library and print. Exit status 0: done, and every
// criterion held; 1: ran, but a criterion failed, the simulation diverged, or output was lost; 2: bad input
// or usage.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace handsim::app {

int run_command_line(int argc, const char* const* argv);

struct HandArguments {
  std::optional<std::filesystem::path> person;  ///< a file, instead of measures
  std::map<std::string, std::string> measures;  ///< by key of a person file
  std::optional<std::filesystem::path> model;   ///< absent: the installed anatomical hand
  std::string side = "both";
  std::optional<std::filesystem::path> out;  ///< absent: only the table
};
int hand_command(const HandArguments& arguments);

struct CheckArguments {
  std::vector<std::filesystem::path> files;
  bool engines = false;  ///< prints which engines can run each scene instead of checking
};
int check_command(const CheckArguments& arguments);

struct SchemaArguments {
  std::string kind;  ///< word of a FileReader
};
int schema_command(const SchemaArguments& arguments);

/// Options of drawing that run, render and grasp have.
struct DrawArguments {
  std::optional<std::filesystem::path> video;
  double fps = 30;
  double speed = 1;
  std::string gl;  ///< osmesa or egl; empty: the default of this build
};

struct RunArguments {
  std::filesystem::path scene;
  std::filesystem::path out;
  std::vector<std::string> overrides;
  std::optional<int> rollout;  ///< of the study that stands in the scene's place
  std::optional<int> seed;     ///< in place of the study's
  int frames = 0;
  std::optional<double> snapshot_at;  ///< [s]
  std::optional<std::filesystem::path> from_snapshot;
  std::optional<std::uint64_t> expected_hash;
  bool poses = false;
  bool plots = false;
  bool report = false;   ///< writes report.html
  bool passing = false;  ///< the folder is removed afterwards, and is not named
  bool quiet = false;
  bool json = false;
  DrawArguments drawing;
};
int run_scene_command(const RunArguments& arguments);

struct RenderArguments {
  std::filesystem::path scene;
  std::optional<std::filesystem::path> out;  ///< of the picture; absent: only the video
  std::vector<std::string> overrides;
  std::optional<double> time;  ///< [s]; absent: the start, of a video the scene's end
  DrawArguments drawing;
};
int render_command(const RenderArguments& arguments);

struct GraspArguments {
  std::vector<std::filesystem::path> scenes;  ///< files or folders
  std::filesystem::path out;
  std::string side;                            ///< right, left, both; empty: the scene's
  std::vector<std::filesystem::path> persons;  ///< files or folders
  std::vector<std::string> overrides;
  std::optional<double> friction;
  bool friction_search = false;
  bool margin = false;
  bool confirm = false;
  bool pictures = false;
  bool report = false;  ///< writes report.html
  DrawArguments drawing;
};
int grasp_command(const GraspArguments& arguments);

struct RolloutsArguments {
  std::filesystem::path study;
  std::filesystem::path out;
  std::vector<std::string> overrides;  ///< of the scene
  std::optional<int> count, seed;      ///< in place of the study's
  int jobs = 0;
  int chunk = 8;
  bool resume = false;
  bool report = false;                         ///< writes report.html
  std::string shard;                           ///< `3/16`; empty: the whole study
  std::vector<std::filesystem::path> folders;  ///< of `merge`
};
int rollouts_command(const RolloutsArguments& arguments);
int merge_command(const RolloutsArguments& arguments);

struct ExportArguments {
  std::optional<std::filesystem::path> scene;
  HandArguments hands;               ///< without a scene; `side` is empty if it was not given
  std::optional<std::string> mount;  ///< of these hands; absent: fixed
  bool muscles = false;              ///< of these hands, with the bands between their joints
  std::filesystem::path out;
  std::optional<std::string> format;  ///< mjcf, urdf or osim; absent: by the ending of `out`, else mjcf
  std::optional<double> time;         ///< of the scene's run, at which the file begins [s]; absent: 0
  std::vector<std::string> overrides;
};
int export_command(const ExportArguments& arguments);

struct ReportArguments {
  std::vector<std::filesystem::path> folders;  ///< of a run or study, or of two runs
  std::optional<std::filesystem::path> out;    ///< absent: report.html in the first folder
};
int report_command(const ReportArguments& arguments);

struct ViewArguments {
  std::filesystem::path scene;
  std::vector<std::string> overrides;
  bool no_browser = false;
};
int view_command(const ViewArguments& arguments);

/// Extension of a file's name in lower case: `.png`; may be empty.
std::string ending_of(const std::filesystem::path& path);

}  // namespace handsim::app
