#include "handsim/app/commands.h"

#include <algorithm>
#include <array>
#include <map>
#include <regex>
#include <vector>

#include <fmt/format.h>

#include "handsim/control/gains.h"
#include "handsim/control/motion_file.h"
#include "handsim/control/motion_trajectory.h"
#include "handsim/control/poses.h"
#include "handsim/core/schema.h"
#include "handsim/core/text.h"
#include "handsim/engine/engine.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/hand/hand_file.h"
#include "handsim/scene/compile/scene.h"
#include "handsim/scene/read/contacts_block.h"
#include "handsim/scene/read/engine_choice.h"
#include "handsim/scene/read/objects.h"
#include "handsim/scene/read/scene_file.h"
#include "handsim/scene/task/tasks.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/rollouts/rollouts_file.h"
#include "handsim/study/track/marker_set.h"
#include "handsim/study/validate/validate.h"

namespace handsim::app {

namespace assets {
extern const std::string_view control_md, keys_md, motion_md, persons_md, rollouts_md, scenes_md;
}  // namespace assets

namespace {

/// Reads a tree only for its problems.
template <auto kRead>
void read_root(const YamlNode& root, Diagnostics& diagnostics) {
  if constexpr (requires { kRead(root, "", diagnostics); })
    kRead(root, "", diagnostics);
  else
    kRead(root, diagnostics);
}

void read_whole_scene(const YamlNode& root, Diagnostics& diagnostics) {
  scene::read_scene(root, scene::task_kinds(), diagnostics);
}

/// A file of muscles by itself: the axes that it names are those of whatever hand includes it.
void read_muscles(const YamlNode& root, Diagnostics& diagnostics) {
  hand::read_muscle_file(root, "", std::nullopt, diagnostics);
}

using scene::FileKind;

constexpr std::array kReaders = {
    FileReader{"scene", FileKind::scene, read_whole_scene},
    FileReader{"person", FileKind::person, read_root<hand::read_person>},
    FileReader{"hand", FileKind::hand_model, read_root<hand::read_hand_spec>},
    FileReader{"controller", FileKind::controller, read_root<control::read_controller>},
    FileReader{"poses", FileKind::poses, read_root<control::read_pose_file>},
    FileReader{"object", FileKind::object, read_root<scene::read_object_file>},
    FileReader{"material", FileKind::material, read_root<scene::read_material_file>},
    FileReader{"anthropometry", FileKind::anthropometry, read_root<hand::read_anthropometry>},
    FileReader{"grip_norms", FileKind::grip_norms, read_root<hand::read_grip_table>},
    FileReader{"muscles", FileKind::muscles, read_muscles},
    FileReader{"measurements", FileKind::measurements, study::read_measurements},
    FileReader{"rollouts", FileKind::rollouts, read_root<study::read_rollouts>},
    FileReader{"names", FileKind::motion_names, read_root<control::read_motion_names>},
    FileReader{"markers", FileKind::marker_set, read_root<study::read_marker_set>},
    FileReader{"costs", FileKind::costs, read_root<scene::read_costs>},
};

/// Reads a file of any kind; the keys of a YAML file show its kind. @returns its kind.
std::string check_file(const std::filesystem::path& path, Diagnostics& diagnostics) {
  if (control::is_motion_file(path.string())) {
    control::read_motion(path);
    return "a motion";
  }
  YamlNode root = load_yaml(path);
  const scene::FileKind kind = scene::kind_of(root).value_or(scene::FileKind::scene);
  const auto reader =
      std::ranges::find_if(file_readers(), [&](const FileReader& each) { return each.kind == kind; });
  if (kind == scene::FileKind::scene) {
    const scene::Scene scene = scene::compile_scene(std::move(root));
    diagnostics.warnings = scene.warnings;
    simulation::check_start(scene);
    static_cast<void>(scene::standalone_text(scene.resolved, scene.inputs));
  } else if (reader != file_readers().end()) {
    reader->read(root, diagnostics);
  } else if (kind == scene::FileKind::study) {
    study::load_accuracy(path);
  } else {
    diagnostics.warnings.push_back("its cases are checked by handsim stability");
  }
  return std::string(scene::described(kind));
}

/// Why an engine cannot run a scene; empty if it can.
std::string refusal(const std::filesystem::path& path, const std::string& engine) {
  try {
    const scene::Scene scene = scene::load_scene(path, {"solver.engine=" + engine});
    simulation::check_start(scene);
    engine::make_engine(scene.model, scene.spec.solver);
    return {};
  } catch (const Error& error) {
    if (error.problems().empty()) return error.what();
    const Problem& first = error.problems().front();
    return fmt::format("{}: got {}, need {}", first.key, first.got, first.need);
  }
}

/// Prints a line for each scene and engine: `runs`, or why not.
void print_engines(const std::vector<std::filesystem::path>& files) {
  for (const std::filesystem::path& path : files)
    if (scene::kind_of(load_yaml(path)).value_or(scene::FileKind::scene) == scene::FileKind::scene)
      for (const std::string engine : {"ode", "dae", "articulated", "auto"}) {
        const std::string why = refusal(path, engine);
        print("{:<44} {:<12} {}\n", path.string(), engine, why.empty() ? "runs" : why);
      }
}

using Texts = std::map<std::string, std::string, std::less<>>;

/// Calls `use` with each place of a text that is as the pattern.
template <class Use>
void each_match(const std::string& text, const char* pattern, const Use& use) {
  const std::regex as(pattern);
  for (std::sregex_iterator at(text.begin(), text.end(), as), end; at != end; ++at) use(*at);
}

/// Adds a table's rows, from `| `key` | ... | meaning |`. @param blocks `scene objects; scene bodies`
void add_table(std::string_view rows, const std::string& blocks, Texts& out) {
  const std::regex row(R"(\|([^|]*)\|(?:.*\|)? ?([^|]*?):? *\|)"), link(R"(`|\[([^\]]*)\]\([^)]*\))"),
      list(R"(\[\])");
  while (rows.starts_with('|')) {
    const std::string line(take_line(rows));
    std::smatch cells;
    if (!std::regex_match(line, cells, row)) continue;
    const std::string keys = std::regex_replace(cells[1].str(), list, ""),
                      text = std::regex_replace(cells[2].str(), link, "$1");
    // `choice: [a, b]` is of the key choice.
    each_match(keys, "`([^`:]*)[^`]*`", [&](const std::smatch& key) {
      each_match(blocks, R"(([\w*]+)( [\w.]+)?(; |$))", [&](const std::smatch& block) {
        out.emplace(block[1].str() + (block[2].matched ? block[2].str() + "." : " ") + key[1].str(), text);
      });
    });
  }
}

Texts read_pages() {
  constexpr std::string_view kMark = "<!-- keys: ";
  Texts out;
  for (std::string_view page : {assets::scenes_md, assets::persons_md, assets::control_md,
                                assets::rollouts_md, assets::motion_md, assets::keys_md})
    for (std::size_t at = page.find(kMark); at != std::string_view::npos; at = page.find(kMark)) {
      page.remove_prefix(at + kMark.size());
      const std::string_view mark = take_line(page);
      add_table(page, std::string(mark.substr(0, mark.find(" -->"))), out);
    }
  return out;
}

/// The meaning of a key, as a page of docs/ says it; empty if none does. A table of keys follows a line
/// `<!-- keys: scene objects; scene bodies -->`: kinds of files, each with the path of the block that has the
/// keys; `*` is any kind. A block without a row for a key has that of the longest path at its end.
/// @param kind word of a FileReader  @param path dotted, without list indices
std::string key_text(std::string_view kind, std::string_view path) {
  static const Texts texts = read_pages();
  while (true) {
    for (const std::string_view of : {kind, std::string_view("*")})
      if (const auto found = texts.find(std::string(of) + " " + std::string(path)); found != texts.end())
        return found->second;
    const std::size_t dot = path.find('.');
    if (dot == std::string_view::npos) return {};
    path.remove_prefix(dot + 1);
  }
}

}  // namespace

std::span<const FileReader> file_readers() { return kReaders; }

int check_command(const CheckArguments& arguments) {
  if (arguments.engines) {
    print_engines(arguments.files);
    return 0;
  }
  int bad = 0;
  for (const std::filesystem::path& path : arguments.files) {
    Diagnostics diagnostics;
    std::string kind;
    try {
      kind = check_file(path, diagnostics);
      diagnostics.throw_if_any();
    } catch (const Error& error) {
      diagnostics.problems = error.problems();
    }
    print_warnings(diagnostics.warnings);
    for (const Problem& problem : diagnostics.problems) print_error("{}\n", problem.text());
    if (diagnostics.problems.empty())
      print("{}: {}, good\n", path.string(), kind);
    else
      ++bad;
  }
  return bad == 0 ? 0 : 2;
}

int schema_command(const SchemaArguments& arguments) {
  std::vector<SchemaSource> sources;
  std::string_view kind;
  for (const FileReader& reader : file_readers()) {
    sources.push_back({scene::described(reader.kind), reader.read});
    if (reader.word == arguments.kind) kind = sources.back().kind;
  }
  print_text(json_schema(kind, sources, [](std::string_view of, std::string_view path) {
    for (const FileReader& reader : file_readers())
      if (scene::described(reader.kind) == of) return key_text(reader.word, path);
    return std::string();
  }));
  return 0;
}

}  // namespace handsim::app
