#include <algorithm>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "handsim/app/commands.h"
#include "handsim/core/text.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/export/export.h"
#include "handsim/output/output_folder.h"
#include "handsim/simulation/simulation.h"

namespace handsim::app {

namespace {

using output::Format, output::kFormats;

/// The requested format, which must agree with the file's ending; without both the first one.
const Format& format_of(const ExportArguments& arguments) {
  const std::string ending = ending_of(arguments.out);
  std::string endings;
  for (const Format& format : kFormats) {
    if (arguments.format && *arguments.format != format.name) continue;
    if (ending.empty() || std::ranges::find(format.endings, ending) != format.endings.end()) {
      if (!format.write)
        throw input_error("--format", std::string(format.name), "python3 -m handsim export, which writes it");
      return format;
    }
    endings += fmt::format("{}{}{}", endings.empty() ? "" : ", ", format.endings_text(),
                           arguments.format ? "" : fmt::format(" ({})", format.name));
  }
  throw input_error(
      "--out", arguments.out.string(),
      "a name that ends in " + endings + (arguments.format ? " for --format " + *arguments.format : ""));
}

/// Refuses options of a person beside a scene, those of a scene beside a person, `--time` of what has none.
void check_source(const ExportArguments& arguments, std::string_view format) {
  if (arguments.time && (!arguments.scene || format != "mjcf"))
    throw input_error("--time", fmt::format("{:g} s", *arguments.time), "a scene, and the format mjcf");
  const HandArguments& hands = arguments.hands;
  const bool person = hands.person || !hands.measures.empty();
  if (!arguments.scene) {
    if (!person)
      throw input_error("scene", "nothing",
                        "a scene file, or a person: --person, or --stature, --mass and --sex");
    if (!arguments.overrides.empty())
      throw input_error("--set", arguments.overrides.front(), "a scene, whose keys it overrides");
    return;
  }
  if (person || hands.model || !hands.side.empty() || arguments.mount || arguments.muscles)
    throw input_error("scene", arguments.scene->string(), "a scene or the options of a person, not both");
}

hand::Mount mount_of(const std::string& name) {
  if (name == "hinge") return hand::Mount::hinge;
  if (name == "universal") return hand::Mount::universal;
  return name == "free" ? hand::Mount::free : hand::Mount::fixed;
}

/// Hands whose parts may touch each other, and what they grip in the other program.
scene::Scene hands_of_person(const ExportArguments& arguments) {
  model::Effects effects;
  for (const model::Effect effect :
       {model::Effect::gravity, model::Effect::self_contact, model::Effect::friction,
        model::Effect::joint_stops, model::Effect::passive_tissue})
    effects.add(effect);
  PersonHands input = read_person_hands(arguments.hands);
  print_warnings(input.warnings);
  if (arguments.muscles) {
    if (!input.model.muscles)
      throw input_error("--muscles", "a hand model without muscles", "a hand model that has muscles");
    effects.add(model::Effect::muscles);
    if (!input.model.muscles->bands.empty()) effects.add(model::Effect::tendon_coupling);
  }
  const std::string& side = arguments.hands.side;
  return compile_hands(side.empty() ? "both" : side, mount_of(arguments.mount.value_or("fixed")), effects,
                       std::move(input));
}

/// The scene's run until a time above 0.
output::Keyframe keyframe_at(const scene::Scene& scene, double time) {
  if (time > scene.spec.duration)
    throw input_error("--time", fmt::format("{:g} s", time),
                      fmt::format("0 to the scene's duration of {:g} s", scene.spec.duration));
  simulation::Simulation run(scene, simulation::no_watchers);
  // Half a step, so that rounding makes no further one.
  while (run.state().time < time - 0.5 * scene.spec.solver.step) run.step();
  return output::keyframe_after(run.state(), run.controller());
}

}  // namespace

std::string ending_of(const std::filesystem::path& path) { return lower_case(path.extension().string()); }

void make_default_folder(const std::filesystem::path& file) {
  if (file.parent_path() == "out") output::make_folder("out");
}

int export_command(const ExportArguments& arguments) {
  const Format& format = format_of(arguments);
  check_source(arguments, format.name);
  const scene::Scene scene =
      arguments.scene ? scene::load_scene(*arguments.scene, arguments.overrides) : hands_of_person(arguments);
  make_default_folder(arguments.out);
  output::check_target("--out", arguments.out, {format.file, format.mark},
                       [&] { return scene::files_read(scene); });
  std::optional<output::Keyframe> moment;
  if (arguments.time.value_or(0) > 0) moment = keyframe_at(scene, *arguments.time);
  output::write_file(arguments.out,
                     format.write({scene.model, scene.spec.solver, scene.control ? &*scene.control : nullptr,
                                   moment ? &*moment : nullptr}));
  if (format.name != "urdf" && model::any_elastic(scene.model.muscles))
    print_warnings({"tendon_strain: elastic tendons are exported as rigid ones"});
  print("{}: {} bodies, {} joints as {}\n", arguments.out.string(), scene.model.bodies.size() - 1,
        scene.model.joints.size(), format.name);
  return 0;
}

}  // namespace handsim::app
