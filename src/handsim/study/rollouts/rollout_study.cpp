#include "handsim/study/rollouts/rollout_study.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "handsim/core/version.h"
#include "handsim/hand/deviations.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/run/output_size.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "handsim/simulation/snapshot.h"
#include "handsim/study/rollouts/rollout_figures.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

constexpr long kMostRollouts = 1'000'000'000;
const std::vector<Column> kOutcome = {{"held", ColumnRole::outcome, false},
                                      {"ended", ColumnRole::outcome, true},
                                      {"ended_at[s]", ColumnRole::outcome, false}};
const std::vector<Column> kLast = {{"error", ColumnRole::outcome, true},
                                   {"state_hash", ColumnRole::outcome, true}};

/// Puts each file that a value of the scene names in its place, so that no rollout reads it again.
/// @param resolved the same value after the scene was read. @param key its dotted path
void follow_files(YamlNode& node, const YamlNode& resolved, const std::string& key) {
  const bool names_file = node.kind == YamlNode::Kind::scalar && resolved.kind == YamlNode::Kind::map;
  if (names_file && resolved.file && *resolved.file != node.place().file) {
    YamlBudget budget;
    follow_reference(node, key, budget);
  }
  const std::string head = key.empty() ? "" : key + ".";
  for (YamlEntry& entry : node.entries)
    if (const YamlNode* same = resolved.find(entry.key)) follow_files(entry.value, *same, head + entry.key);
  for (std::size_t i = 0; i < std::min(node.items.size(), resolved.items.size()); ++i)
    follow_files(node.items[i], resolved.items[i], head + std::to_string(i));
}

std::string on_one_line(std::string text) {
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos;) text.replace(at, 1, "; ");
  return text;
}

/// A problem of a value that the study has put into the scene belongs to the study's key.
Problem at_key(const Problem& problem, const std::vector<BoundKey>& keys) {
  Problem out = problem;
  for (const BoundKey& bound : keys)
    for (const std::string& path : bound.paths)
      if (problem.place && problem.place->file == "--set " + path) {
        out.place = bound.key.place;
        out.key = "vary." + bound.key.key;
        if (problem.key != path) out.got = fmt::format("{}: {}", problem.key, problem.got);
      }
  return out;
}

void record(const Simulation& simulation, TimeSeries& out) {
  const long every = simulation::record_steps(simulation.scene().spec);
  if (simulation.steps() % every != 0) return;
  if (out.columns.empty()) out.columns = output::trajectory_columns(simulation.model());
  const std::vector<double> row = output::trajectory_values(simulation.state());
  out.values.insert(out.values.end(), row.begin(), row.end());
}

/// A run's cells, by the name of their column.
struct Outcome {
  std::map<std::string, Cell> cells;
  bool stopped = false;
};

void take_figures(const Simulation& simulation, bool diverged, Outcome& out) {
  for (auto& [name, cell] : figures_of(simulation)) out.cells[name] = std::move(cell);
  if (const auto held = is_held(simulation, diverged)) out.cells["held"] = *held ? 1.0 : 0.0;
  out.cells["ended"] = diverged ? "diverged" : ended(simulation);
  out.cells["ended_at[s]"] = simulation.state().time;
  out.cells["state_hash"] = simulation::hash_text(simulation.state_hash());
}

/// To the end, or to what ends it.
/// @param curves for bands, or null
Outcome run_to_end(Simulation& simulation, bool stop_lost, const std::atomic<bool>& stop,
                   std::optional<TimeSeries>& trajectory, TimeSeries* curves = nullptr) {
  Outcome out;
  bool diverged = false;
  try {
    if (trajectory) record(simulation, *trajectory);
    const long steps = simulation.step_count(), every = std::max(1L, steps / kBandRows);
    while (simulation.steps() < steps && !over(simulation, stop_lost)) {
      if (stop.load(std::memory_order_relaxed)) return {{}, true};
      simulation.step();
      if (trajectory) record(simulation, *trajectory);
      if (curves && simulation.steps() % every == 0) add_curves(simulation, *curves);
    }
  } catch (const Error& error) {
    if (!error.fault()) throw;
    diverged = true;
    out.cells["error"] = on_one_line(error.what());
  }
  take_figures(simulation, diverged, out);
  return out;
}

}  // namespace

RolloutStudy::RolloutStudy(RolloutsSpec spec) : spec_(std::move(spec)) {
  Diagnostics diagnostics;
  root_ = load_yaml(spec_.scene, diagnostics.budget);
  for (const std::string& assignment : spec_.set) try {
      apply_override(root_, assignment, diagnostics.budget);
    } catch (const Error& error) {
      add_at_set(error, key_of(assignment), diagnostics);
    }
  diagnostics.throw_if_any();
  // Sums of contact forces are measured only where they are recorded.
  if (std::ranges::any_of(spec_.outcomes,
                          [](const std::string& of) { return of.starts_with("contact_forces"); }))
    apply_override(root_, "record.contacts=true", diagnostics.budget);
  scene::Scene base;
  try {
    base = scene::compile_scene(root_);
  } catch (const Error& error) {
    add_at_set(error, {}, diagnostics);
    diagnostics.throw_if_any();
  }
  files_ = scene::files_read(base);
  // Bands of contact forces.
  if (spec_.bands && base.spec.solver.effects.any_contact() && !base.spec.solver.contact_forces)
    apply_override(root_, "record.contacts=true", diagnostics.budget);
  follow_files(root_, base.resolved, "");
  if (spec_.uncertain) add_uncertain(base);
  if (spec_.vary.empty())
    throw input_error("uncertain", "a scene without hands and without materials with a spread",
                      "one with some");
  for (const VariedKey& key : spec_.vary) {
    try {
      keys_.push_back(bind(key, base.resolved));
    } catch (const Error& error) {
      diagnostics.add(error);
    }
  }
  diagnostics.throw_if_any();
  check_paths(diagnostics);
  diagnostics.throw_if_any();
  double size = spec_.count;
  for (const BoundKey& bound : keys_)
    if (bound.key.from == VariedKey::From::levels) {
      combinations_ *= static_cast<long>(bound.key.levels.size());
      size *= static_cast<double>(bound.key.levels.size());
      if (size > static_cast<double>(kMostRollouts))
        throw input_error("count", fmt::format("{:g} rollouts with all levels", size),
                          fmt::format("at most {}", kMostRollouts));
    }
  head_.size = spec_.count * combinations_;
  check_keys();
}

/// Deviations of the hands that act, and the frictions and stiffnesses of materials with a spread.
void RolloutStudy::add_uncertain(const scene::Scene& scene) {
  const auto vary = [&](std::string key, double mean, double deviation) {
    const auto has = [&](const VariedKey& given) { return given.key == key; };
    if (!(deviation > 0) || std::ranges::any_of(spec_.vary, has)) return;
    VariedKey& varied = spec_.vary.emplace_back();
    varied.key = std::move(key);
    varied.from = VariedKey::From::normal;
    varied.mean = {{mean, ""}};
    varied.high = {{deviation, ""}};
  };
  const auto number_at = [&](const std::string& path) {
    const YamlNode* node = value_at(scene.resolved, path);
    return node && node->kind == YamlNode::Kind::scalar ? any_quantity(node->text) : std::nullopt;
  };
  const bool muscles = scene.spec.solver.effects.has(model::Effect::muscles);
  const std::vector<scene::HandEntry>& hands = scene.spec.hands;
  // Both hands of a person differ from what is predicted alike.
  const bool one = std::ranges::all_of(hands, [&](const scene::HandEntry& hand) {
    return hand::same_body(hand.person, hands.front().person) && hand.model == hands.front().model;
  });
  for (std::size_t i = 0; i < (one ? std::min<std::size_t>(1, hands.size()) : hands.size()); ++i)
    for (const std::string& name : hand::uncertain_of(*hands[i].model, hands[i].person, muscles))
      // A motion that was recorded is within its hand's ranges and strength.
      if (!spec_.measure || (name != "ranges" && name != "grip_strength"))
        vary(fmt::format("hands.{}.person.deviations.{}", one && hands.size() > 1 ? "*" : std::to_string(i),
                         name),
             0, 1);
  const YamlNode* contacts = scene.resolved.find("contacts");
  const YamlNode* materials = contacts ? contacts->find("materials") : nullptr;
  for (std::size_t i = 0; materials && i < materials->items.size(); ++i)
    for (const auto& [name, key] : {std::pair("friction", "friction"), std::pair("stiffness", "stiffness"),
                                    std::pair("depth", "exponential.depth")}) {
      const std::string material = fmt::format("contacts.materials.{}.", i);
      const auto spread = number_at(material + "spread." + name), value = number_at(material + key);
      if (spread && value) vary(material + key, *value, *spread * *value);
    }
}

scene::Scene RolloutStudy::compile(const std::vector<std::string>& overrides) const {
  YamlNode root = root_;
  YamlBudget budget;
  for (const std::string& assignment : overrides) apply_override(root, assignment, budget);
  return scene::compile_scene(std::move(root));
}

/// Each value that is probed, beside the first one of every other key. What the scene itself cannot have
/// beside these, as a grip that is too weak for the heaviest object, is refused rollout by rollout.
void RolloutStudy::check_keys() {
  std::vector<std::vector<std::string>> values;
  for (const BoundKey& bound : keys_) values.push_back(probes(bound));
  std::vector<Problem> problems;
  const auto check = [&](std::size_t key, std::size_t value) {
    std::vector<std::string> overrides;
    for (std::size_t k = 0; k < keys_.size(); ++k)
      for (const std::string& path : keys_[k].paths)
        overrides.push_back(path + "=" + values[k][k == key ? value : 0]);
    try {
      const scene::Scene scene = compile(overrides);
      note_overruled(scene);
      take_sample(scene);
    } catch (const Error& error) {
      for (const Problem& problem : error.problems()) {
        if (problem.place && problem.place->file == spec_.scene.string())
          refused_.emplace(std::vector{problem});
        else
          problems.push_back(at_key(problem, keys_));
      }
    }
    return problems.empty();
  };
  // Where the first values are wrong, so are all others.
  if (check(0, 0))
    for (std::size_t k = 0; k < keys_.size(); ++k)
      for (std::size_t v = 1; v < values[k].size(); ++v) check(k, v);
  if (problems.empty()) problems = idle_keys();
  if (!problems.empty()) throw Error(std::move(problems));
  make_head();
}

/// Other levels may have figures of their own, and name files of their own.
void RolloutStudy::take_sample(const scene::Scene& scene) {
  scene_hash_ = hash_bytes(emit_yaml(scene::standalone(scene.resolved, scene.inputs)), scene_hash_);
  for (const scene::ReferencedFile& input : scene.inputs) scene_hash_ = hash_bytes(*input.bytes, scene_hash_);
  for (std::filesystem::path& file : scene::files_read(scene))
    if (std::ranges::find(files_, file) == files_.end()) files_.push_back(std::move(file));
  if (spec_.measure && sample_) return;
  try {
    for (const auto& [name, cell] :
         spec_.measure ? spec_.measure(scene).figures : figures_of(Simulation(scene))) {
      const bool text = name.ends_with("outcome") || name.ends_with("last_touched_by");
      const Column column = {name, ColumnRole::figure, text};
      if (std::ranges::find(figures_, column) == figures_.end()) figures_.push_back(column);
    }
    if (!sample_) sample_ = scene;
  } catch (const Error& error) {
    refused_ = error;
  }
}

/// The columns of the study's outcomes: figures, or those of summary.json, which the end of a run shows.
void RolloutStudy::collect_outcomes() {
  std::vector<std::string> known;
  for (const Column& column : figures_)
    if (!column.text) known.push_back(column.name);
  const std::string need = list_of(known) + ", or the path of a number in summary.json";
  std::map<std::string, double> summary;
  Diagnostics diagnostics;
  if (spec_.uncertain && spec_.outcomes.empty())
    for (Column& column : figures_)
      if (!column.text) column.role = ColumnRole::asked;
  for (const std::string& name : spec_.outcomes) {
    const auto found = std::ranges::find_if(figures_, [&](const Column& column) {
      return !column.text && (column.name == name || column.name.starts_with(name + "["));
    });
    if (name == "held") continue;  // is one in any case
    if (found != figures_.end()) {
      found->role = ColumnRole::asked;
      continue;
    }
    if (!reads_summary_) {
      Simulation simulation(*sample_);
      std::optional<TimeSeries> none;
      run_to_end(simulation, spec_.stop_lost, false, none);
      summary = summary_figures(simulation);
      for (const auto& [path, value] : summary) known.push_back(path);
      reads_summary_ = true;
    }
    if (summary.contains(name))
      figures_.push_back({name, ColumnRole::asked, false});
    else
      diagnostics.problems.push_back(
          {spec_.outcome_place, "outcome", name, need + nearest_hint(name, known)});
  }
  diagnostics.throw_if_any();
}

void RolloutStudy::make_head() {
  // An object may start within the hand of some persons, but not of all.
  if (refused_ && figures_.empty()) throw *refused_;
  check_record_and_stop();
  collect_outcomes();
  head_.title = spec_.title;
  head_.seed = std::to_string(spec_.seed);
  std::vector<Column>& columns = head_.columns;
  const auto add = [&](const std::vector<Column>& more) {
    columns.insert(columns.end(), more.begin(), more.end());
  };
  add({{"rollout", ColumnRole::index, false}});
  for (const BoundKey& bound : keys_) add(bound.columns);
  add(kOutcome);
  const auto wanted = [&](const std::string& name) {
    return spec_.figures.empty() || std::ranges::find(spec_.figures, name) != spec_.figures.end();
  };
  for (const Column& column : figures_)
    if (column.role == ColumnRole::asked || wanted(column.name)) columns.push_back(column);
  add(kLast);
  std::string study = fmt::format("{} {}\n", spec_.count, spec_.seed) + emit_yaml(spec_.resolved);
  for (const std::string& assignment : spec_.set) study += "\n" + assignment;
  head_.origin = {fmt::format("study {:016x}", hash_bytes(study)), fmt::format("scene {:016x}", scene_hash_),
                  fmt::format("handsim {}, commit {}, {}", kVersion, kCommit, kOde),
                  simulation::mathematics()};
}

RolloutStudy::Choice RolloutStudy::choose(long rollout) const {
  if (rollout < 0 || rollout >= size())
    throw input_error("--rollout", std::to_string(rollout), fmt::format("0 to {}", size() - 1));
  Choice out;
  const long number = rollout / combinations_;
  long rest = rollout % combinations_;
  for (const BoundKey& bound : keys_) {
    std::size_t level = 0;
    if (bound.key.from == VariedKey::From::levels) {
      const long levels = static_cast<long>(bound.key.levels.size());
      level = static_cast<std::size_t>(rest % levels);
      rest /= levels;
    }
    Drawn drawn = draw(bound, spec_.seed, number, level);
    for (const std::string& path : bound.paths) out.overrides.push_back(path + "=" + drawn.yaml);
    out.cells.insert(out.cells.end(), drawn.cells.begin(), drawn.cells.end());
  }
  return out;
}

std::vector<std::string> RolloutStudy::overrides(long rollout) const { return choose(rollout).overrides; }

scene::Scene RolloutStudy::scene(long rollout) const { return compile(overrides(rollout)); }

std::optional<RolloutRow> RolloutStudy::run(long rollout, const std::atomic<bool>& stop) const {
  const Choice choice = choose(rollout);
  RolloutRow row;
  row.rollout = rollout;
  if (rollout < spec_.trajectories) row.trajectory.emplace();
  Outcome outcome;
  try {
    const scene::Scene scene = compile(choice.overrides);
    if (spec_.measure) {
      Findings found = spec_.measure(scene);
      outcome.cells = {found.figures.begin(), found.figures.end()};
      outcome.cells["ended"] = "end";
      row.curves = std::move(found.curves);
    } else {
      Simulation simulation(scene);
      outcome =
          run_to_end(simulation, spec_.stop_lost, stop, row.trajectory, spec_.bands ? &row.curves : nullptr);
      if (reads_summary_)
        for (const auto& [path, value] : summary_figures(simulation)) outcome.cells.emplace(path, value);
    }
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::input) throw;
    row.trajectory.reset();
    outcome.cells = {{"ended", "refused"}, {"error", on_one_line(error.what())}};
  }
  if (outcome.stopped) return std::nullopt;
  row.cells = cells_of(rollout, choice, std::move(outcome.cells));
  return row;
}

RolloutRow RolloutStudy::ended_row(long rollout, const std::string& ended, const std::string& error) const {
  RolloutRow row;
  row.rollout = rollout;
  row.cells = cells_of(rollout, choose(rollout), {{"ended", ended}, {"error", on_one_line(error)}});
  return row;
}

std::vector<Cell> RolloutStudy::cells_of(long rollout, const Choice& choice,
                                         std::map<std::string, Cell> outcome) const {
  std::vector<Cell> out = {static_cast<double>(rollout)};
  out.insert(out.end(), choice.cells.begin(), choice.cells.end());
  for (std::size_t i = out.size(); i < head_.columns.size(); ++i)
    out.push_back(std::move(outcome[head_.columns[i].name]));
  return out;
}

}  // namespace handsim::study
