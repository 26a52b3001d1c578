#include "handsim/study/grasp/grasp_study.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "handsim/core/data_folder.h"
#include "handsim/core/units.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/output_folder.h"
#include "handsim/simulation/run/step_choice.h"
#include "handsim/simulation/simulation.h"

namespace handsim::study {

namespace {

constexpr int kBisections = 6;
constexpr double kMarginShare = 0.05;  ///< of friction and mass, up and down

bool has_grasps(const std::filesystem::path& file) {
  const YamlNode root = load_yaml(file);
  return root.kind == YamlNode::Kind::map && (root.find("grasps") || root.find("climbs"));
}

/// The file, or the YAML files of the folder, sorted.
std::vector<std::filesystem::path> opened(const std::filesystem::path& path) {
  if (!std::filesystem::is_directory(path)) return {path};
  std::vector<std::filesystem::path> out;
  for (const auto& entry : std::filesystem::directory_iterator(path))
    if (entry.path().extension() == ".yaml") out.push_back(entry.path());
  std::ranges::sort(out);
  return out;
}

/// The scene files that are meant.
std::vector<std::filesystem::path> files_of(const std::vector<std::filesystem::path>& given) {
  std::vector<std::filesystem::path> out;
  for (const std::filesystem::path& path : given) {
    const std::size_t before = out.size();
    for (const std::filesystem::path& file : opened(path))
      if (has_grasps(file)) out.push_back(file);
    if (out.size() > before) continue;
    if (std::filesystem::is_directory(path))
      throw input_error("scenes", path.string() + ", a folder without grasp scenes", "a folder with some");
    throw input_error("scenes", path.string() + ", which has no grasps",
                      "scenes with a grasps or climbs block");
  }
  return out;
}

/// One run to come.
struct Work {
  std::string name, side;
  std::filesystem::path file;
  std::vector<std::string> overrides;
  scene::Scene scene;
};

/// Files of persons; one without a value: the scene's own.
std::vector<std::optional<std::filesystem::path>> persons_of(const GraspStudy& study) {
  std::vector<std::optional<std::filesystem::path>> out;
  for (const std::filesystem::path& path : study.persons)
    for (const std::filesystem::path& file : opened(path)) out.emplace_back(file);
  if (out.empty()) return {std::nullopt};
  std::ranges::sort(out);
  return out;
}

/// True if all problems are that a grasp does not fit its hand.
bool does_not_fit(const Error& error) {
  return std::ranges::all_of(error.problems(), [](const Problem& problem) {
    return problem.key.starts_with("grasps.") && problem.key.find('.', 7) == std::string::npos;
  });
}

/// Why a hand of another size cannot start where the scene has it: it is inside an object. Empty: it can.
std::string blocked(const scene::Scene& scene) {
  try {
    simulation::check_start(scene);
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

/// @param refused grasps and climbs that do not fit a person's hand
std::vector<Work> load(const GraspStudy& study, std::vector<RefusedGrasp>& refused) {
  std::vector<Work> out;
  std::set<std::string> names;
  Diagnostics diagnostics;
  for (const std::filesystem::path& file : files_of(study.scenes)) {
    const std::vector<std::string> sides = study.sides.empty() ? std::vector<std::string>{""} : study.sides;
    for (const auto& person : persons_of(study))
      for (const std::string& side : sides) {
        std::vector<std::string> overrides = study.overrides;
        std::string name = file.stem().string();
        if (person) {
          overrides.push_back("hands.0.person=" + std::filesystem::absolute(*person).string());
          name += "_" + person->stem().string();
        }
        if (!side.empty()) overrides.push_back("hands.0.side=" + side);
        try {
          if (!names.insert(name + "_" + side).second)
            throw input_error("scenes", file.string() + ", whose name another has",
                              "names of their own, by which the runs' folders are called");
          Work work{name, side, file, overrides, scene::load_scene(file, overrides)};
          if (study.friction) set_friction(work.scene, *study.friction);
          work.scene = simulation::with_chosen_step(std::move(work.scene), [&] {
            if (study.progress) study.progress(0);
          });
          if (const std::string why = person ? blocked(work.scene) : ""; !why.empty())
            refused.push_back({name, side, why});
          else
            out.push_back(std::move(work));
        } catch (const Error& error) {
          if (error.kind() != ErrorKind::input) throw;
          if (person && does_not_fit(error))
            refused.push_back({name, side, error.what()});
          else
            diagnostics.add(error);
        }
      }
  }
  diagnostics.throw_if_any();
  return out;
}

/// The figures of the same grasps at half the step.
std::vector<simulation::GraspFigures> at_half_step(const GraspStudy& study, const Work& work) {
  std::vector<std::string> overrides = work.overrides;
  overrides.push_back(fmt::format("solver.step={}", 0.5 * work.scene.spec.solver.step));
  scene::Scene scene = scene::load_scene(work.file, overrides);
  if (study.friction) set_friction(scene, *study.friction);
  return simulate(scene);
}

simulation::RunOptions options_of(const GraspStudy& study, const Work& work) {
  simulation::RunOptions options;
  options.out = study.out / (work.side.empty() ? work.name : work.name + "_" + work.side);
  options.pose_pictures = study.pictures;
  options.video = study.video;
  if (options.video) options.video->file = options.out / options.video->file;
  options.gl = study.gl;
  options.draw_apart = study.draw_apart;
  options.stop_lost = true;
  return options;
}

/// Writes a friction into the scene's tree, which has the keys of all surfaces, to repeat the run from it.
void write_friction(YamlNode& node, double friction) {
  YamlNode* own = node.find("friction");
  YamlNode* spinning = node.find("spinning_friction");
  if (own && spinning) {
    const double before = parse_number(own->text).value_or(0),
                 moment = parse_number(spinning->text).value_or(0);
    if (before > 0) *spinning = yaml_scalar(number_text(moment * (friction / before)));
    *own = yaml_scalar(number_text(friction));
  }
  for (YamlNode& item : node.items) write_friction(item, friction);
  for (YamlEntry& entry : node.entries) write_friction(entry.value, friction);
}

bool all_held(const std::vector<simulation::GraspFigures>& grasps) {
  return std::ranges::all_of(grasps, [](const simulation::GraspFigures& g) { return g.held; });
}

void scale_friction(scene::Scene& scene, double factor) {
  for (model::Material& material : scene.model.materials) {
    material.friction *= factor;
    material.spinning_friction *= factor;
  }
}

/// The shipped norms of grip strength.
const hand::GripTable& norms() {
  static const hand::GripTable table = [] {
    YamlNode root = load_yaml(data_folder() / "handmodels/grip_strength.yaml");
    Diagnostics diagnostics;
    hand::GripTable out = hand::read_grip_table(root, "", diagnostics);
    diagnostics.throw_if_any();
    return out;
  }();
  return table;
}

/// A row for each of a run's grasps or climbs.
/// @param plans one for each of them
template <class Row, class Figures, class Plan>
std::vector<Row> rows_of(const Work& work, const simulation::RunResult& result,
                         const std::vector<Figures>& figures, const std::vector<Plan>& plans) {
  RunRow run{.scene = work.name,
             .side = {},
             .passed = result.passed(),
             .simulated = result.simulated,
             .wall = result.wall,
             .fault = {}};
  if (result.fault) run.fault = Error(*result.fault).what();
  std::vector<Row> rows;
  for (std::size_t i = 0; i < figures.size(); ++i) {
    Row& row = rows.emplace_back();
    static_cast<RunRow&>(row) = run;
    const scene::HandEntry& hand = work.scene.spec.hands[plans[i].hand];
    row.side = hand.placement.name;
    row.stature = hand.person.stature;
    row.hand_length = work.scene.hands[plans[i].hand].size.length;
    row.grip_strength = hand::grip_strength(norms(), hand.person).own;
    row.figures = figures[i];
  }
  return rows;
}

}  // namespace

bool GraspRow::uncertain() const {
  if (!half_step) return false;
  if (figures.outcome() != half_step->outcome()) return true;
  if (!figures.margin_measured() || !half_step->margin_measured()) return false;
  const double whole = figures.margin(), half = half_step->margin();
  return std::min(std::abs(whole), std::abs(half)) < std::abs(whole - half);
}

void set_friction(scene::Scene& scene, double friction) {
  for (model::Material& material : scene.model.materials) {
    if (material.friction > 0) material.spinning_friction *= friction / material.friction;
    material.friction = friction;
  }
  write_friction(scene.resolved, friction);
}

std::vector<simulation::GraspFigures> simulate(const scene::Scene& scene) {
  simulation::Simulation simulation(scene, simulation::only<simulation::Monitor, simulation::Grasps>);
  const long steps = simulation.step_count();
  try {
    for (long i = 0; i < steps && !simulation::over(simulation, true); ++i) simulation.step();
  } catch (const Error& error) {
    if (!error.fault()) throw;
  }
  return simulation.figures<simulation::Grasps>();
}

void scale_object_mass(scene::Scene& scene, double factor) {
  for (const scene::GraspPlan& plan : scene.plans.grasps)
    for (model::Body& body : scene.model.bodies) {
      if (body.name != plan.object) continue;
      body.mass *= factor;
      body.inertia *= factor;
    }
}

std::string turning(const scene::Scene& scene, bool is_held, const std::function<void(double)>& told) {
  struct Change {
    const char* name;
    void (*make)(scene::Scene&, double);
    double share;
  };
  double done = 0;
  for (const Change& change : {Change{"5 % less friction", scale_friction, -kMarginShare},
                               Change{"5 % more mass", scale_object_mass, kMarginShare},
                               Change{"5 % more friction", scale_friction, kMarginShare},
                               Change{"5 % less mass", scale_object_mass, -kMarginShare}}) {
    scene::Scene trial = scene;
    change.make(trial, 1 + change.share);
    if (all_held(simulate(trial)) != is_held) return change.name;
    if (told) told(done += 0.25);
  }
  return {};
}

std::optional<double> smallest_friction(const scene::Scene& scene, const std::function<void(double)>& told) {
  double high = 0;
  for (const model::Material& material : scene.model.materials) high = std::max(high, material.friction);
  double low = 0;
  scene::Scene trial = scene;
  const auto holds = [&](double friction) {
    trial.model = scene.model;
    set_friction(trial, friction);
    return all_held(simulate(trial));
  };
  if (!holds(high)) return std::nullopt;
  for (int i = 0; i < kBisections; ++i) {
    if (told) told((i + 1.0) / (kBisections + 1));
    const double middle = 0.5 * (low + high);
    (holds(middle) ? high : low) = middle;
  }
  return high;
}

GraspTables run_grasps(const GraspStudy& study) {
  GraspTables tables;
  const std::vector<Work> all = load(study, tables.refused);
  const auto scenes = [&] {
    std::vector<std::filesystem::path> out;
    for (const Work& work : all)
      for (std::filesystem::path& file : scene::files_read(work.scene)) out.push_back(std::move(file));
    return out;
  };
  // All folders are had before the first run, which may take minutes.
  tables.folder = std::make_unique<output::OutputFolder>(
      study.out,
      std::vector<std::string>{"grasps.csv", "grasps.json", "climbs.csv", "climbs.json", "study.json",
                               "report.html"},
      scenes);
  std::vector<output::OutputFolder> folders;
  for (const Work& work : all) folders.push_back(simulation::run_folder(work.scene, options_of(study, work)));
  tables.folder->clear();
  for (const output::OutputFolder& of_run : folders) of_run.clear();
  const double share = 1.0 / static_cast<double>(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Work& work = all[i];
    const double own = study.friction_search || study.margin || study.confirm ? 0.2 : 1;
    const auto tell = [&](double from, double part) {
      return [&study, begin = (static_cast<double>(i) + from) * share, span = part * share](double done) {
        if (study.progress) study.progress(begin + done * span);
      };
    };
    simulation::RunOptions options = options_of(study, work);
    options.progress = tell(0, own);
    const simulation::RunResult result = simulation::run(work.scene, options, &folders[i]);
    for (const std::string& what : result.missing)
      tables.missing.push_back(options.out.string() + ": " + what);
    auto found = rows_of<GraspRow>(work, result, result.grasps, work.scene.plans.grasps);
    const auto climbs = rows_of<ClimbRow>(work, result, result.climbs, work.scene.plans.climbs);
    if (study.margin && !found.empty()) {
      const bool held = std::ranges::all_of(found, [](const auto& r) { return r.figures.held; });
      const std::string what = turning(work.scene, held, tell(own, 1 - own));
      for (GraspRow& row : found) row.turning = what;
    }
    if (study.confirm && !found.empty()) {
      const auto half = at_half_step(study, work);
      for (std::size_t k = 0; k < found.size(); ++k) found[k].half_step = half[k];
    }
    if (study.friction_search && !found.empty()) {
      const bool search = result.passed();
      const auto least = search ? smallest_friction(work.scene, tell(own, 1 - own)) : std::optional<double>();
      for (GraspRow& row : found) {
        row.smallest_friction = least;
        if (!search) row.not_searched = "the scene's own friction does not meet all criteria";
      }
    }
    tables.grasps.insert(tables.grasps.end(), found.begin(), found.end());
    tables.climbs.insert(tables.climbs.end(), climbs.begin(), climbs.end());
  }
  return tables;
}

std::vector<UncertainGrasp> uncertain_grasps(const GraspStudy& study, std::vector<RefusedGrasp>& refused) {
  std::vector<UncertainGrasp> out;
  for (const Work& work : load(study, refused))
    out.push_back({work.name, work.scene.spec.hands[0].placement.name, work.file, work.overrides,
                   options_of(study, work).out});
  return out;
}

}  // namespace handsim::study
