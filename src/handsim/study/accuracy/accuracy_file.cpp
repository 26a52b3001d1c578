#include <fmt/format.h>

#include "handsim/core/yaml_reader.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/spec_reader.h"

namespace handsim::study {

namespace {

AccuracyMethod read_method(MapReader reader, const std::vector<double>& steps) {
  AccuracyMethod method;
  method.name = reader.text("name");
  method.set = read_set(reader, "set");
  method.scene = read_scene_path(reader, false);
  if (reader.has("observe")) method.observe = reader.text("observe");
  if (reader.has("line")) method.line = reader.text("line");
  method.steps = read_steps(reader, "steps", false);
  if (method.steps.empty()) method.steps = steps;
  reader.finish();
  return method;
}

constexpr std::size_t kMostMethods = 1000;

}  // namespace

AccuracySpec load_accuracy(const std::filesystem::path& path) {
  YamlNode root = load_yaml(path);
  Diagnostics diagnostics;
  if (!scene::is_of_kind(root, "", scene::FileKind::study, diagnostics)) throw Error(diagnostics.problems);
  MapReader reader(root, "", diagnostics);
  AccuracySpec spec;
  spec.title = reader.text("title", "what accuracy costs");
  spec.scene = read_scene_path(reader, true).value_or("");
  spec.reference =
      reader.choice<Reference>("reference", {{"slider_crank_iftomm", Reference::slider_crank_iftomm},
                                             {"slider_crank_torque", Reference::slider_crank_torque},
                                             {"method", Reference::method},
                                             {"smallest_step", Reference::smallest_step}});
  spec.reference_set = read_set(reader, "reference_set");
  if (reader.has("reference_set") != (spec.reference == Reference::method))
    reader.problem("reference_set",
                   reader.has("reference_set") ? "overrides for a reference that is not a method" : "nothing",
                   "overrides if reference is method, and only then");
  if (reader.has("observe")) spec.observe = reader.text("observe");
  spec.sample_every = reader.number("sample_every", kStepRange, 0.01);
  spec.early = reader.number("early", {Dimension::time, 0, 1e5}, 0.5);
  spec.repeats = reader.integer("repeats", 1, 1000, 5);
  const std::vector<double> steps = read_steps(reader, "steps", true);
  spec.plot_steps = read_steps(reader, "plot_steps", false);
  const YamlNode* list = reader.list("methods", true, kMostMethods);
  for (std::size_t i = 0; list && i < list->items.size(); ++i)
    spec.methods.push_back(
        read_method(MapReader(list->items[i], fmt::format("methods.{}", i), diagnostics), steps));
  if (spec.methods.empty()) reader.problem("methods", "no method", "at least one method");
  reader.finish();
  diagnostics.throw_if_any();
  return spec;
}

}  // namespace handsim::study
