// Hands straight from a person, without a scene.
#include <algorithm>

#include "handsim/app/commands.h"
#include "handsim/core/data_folder.h"
#include "handsim/hand/doubts.h"

namespace handsim::app {

namespace {

/// A person from the options, with the keys of a person file.
YamlNode person_of_options(const HandArguments& arguments) {
  YamlNode person = yaml_map();
  for (const auto& [key, value] : arguments.measures) yaml_put(person, key, yaml_scalar(value));
  return person;
}

/// `--hand-length` for `hand_length` or `hands.0.person.hand_length`.
std::string option_name(const std::string& key) {
  std::string name = key.substr(key.rfind('.') + 1);
  std::ranges::replace(name, '_', '-');
  return "--" + name;
}

/// Problems of a person without a file as problems of the options, those of files with the files' keys.
std::vector<Problem> option_problems(std::vector<Problem> problems) {
  for (Problem& problem : problems) {
    for (const std::string head : {"hands.0.model.", "hands.0.person."})
      if (problem.key.starts_with(head)) problem.key.erase(0, head.size());
    if (!problem.place || !problem.place->file.empty()) continue;
    problem.place.reset();
    problem.key = option_name(problem.key);
  }
  return problems;
}

}  // namespace

PersonHands read_person_hands(const HandArguments& arguments) {
  YamlNode person = person_of_options(arguments);
  if (arguments.person && !person.entries.empty())
    throw input_error(option_name(person.entries.front().key), "a value beside --person", "one of the two");
  if (arguments.person) person = load_yaml(*arguments.person);
  PersonHands out;
  Diagnostics diagnostics;
  YamlNode& person_node = yaml_put(out.files, "person", std::move(person));
  YamlNode& model_node = yaml_put(
      out.files, "model", load_yaml(arguments.model.value_or(data_folder() / "handmodels/anatomical.yaml")));
  if (!arguments.person || scene::is_of_kind(person_node, "", scene::FileKind::person, diagnostics))
    out.person = hand::read_person(person_node, "", diagnostics);
  const std::size_t of_person = diagnostics.resolution.size();
  if (scene::is_of_kind(model_node, "", scene::FileKind::hand_model, diagnostics))
    out.model = hand::read_hand_spec(model_node, "", diagnostics);
  if (!diagnostics.problems.empty()) throw Error(option_problems(diagnostics.problems));
  model_node = diagnostics.resolution.applied(model_node, "", of_person);
  out.warnings = std::move(diagnostics.warnings);
  const std::string where = person_node.place().text();
  for (const std::string& text : hand::doubts(out.model, out.person)) out.warnings.push_back(where + text);
  return out;
}

scene::Scene compile_hands(const std::string& side, hand::Mount mount, const model::Effects& effects,
                           PersonHands input) {
  scene::SceneSpec spec;
  spec.title = "hands";
  spec.pictures.view = scene::View::dorsal;
  spec.solver.effects = effects;
  // A hand is about 0.11 statures long.
  const double distance = 1.35 * 0.11 * input.person.stature;
  for (const model::Side of : {model::Side::left, model::Side::right}) {
    const bool left = of == model::Side::left;
    if (side != "both" && side != (left ? "left" : "right")) continue;
    scene::HandEntry& entry = spec.hands.emplace_back();
    entry.model = std::make_shared<const hand::HandSpec>(input.model);
    entry.person = input.person;
    entry.placement.name = left ? "left" : "right";
    entry.placement.side = of;
    entry.placement.mount = mount;
    entry.placement.pose.p = {side != "both" ? 0 : (left ? -0.5 : 0.5) * distance, 0.0, 0.2};
  }
  try {
    return scene::compile_scene(std::move(spec), std::move(input.files));
  } catch (const Error& error) {
    throw Error(option_problems(error.problems()));
  }
}

}  // namespace handsim::app
