#include <fmt/format.h>

#include "handsim/app/console.h"
#include "handsim/app/motion_command.h"
#include "handsim/app/progress.h"
#include "handsim/output/output_folder.h"
#include "handsim/scene/read/blocks.h"

namespace handsim::app {

namespace {

control::MotionNames load_names(const std::filesystem::path& path) {
  Diagnostics diagnostics;
  YamlNode root = load_yaml(path, diagnostics.budget);
  control::MotionNames out;
  if (scene::is_of_kind(root, "", scene::FileKind::motion_names, diagnostics))
    out = control::read_motion_names(root, "", diagnostics);
  diagnostics.throw_if_any();
  return out;
}

/// The scene; --muscles puts them in effect.
scene::Scene with_muscles(const InverseArguments& arguments) {
  scene::Scene scene = scene::load_scene(arguments.scene, arguments.overrides);
  using model::Effect;
  const auto touches = [&](Effect effect) {
    return effect == Effect::self_contact || effect == Effect::object_contact || effect == Effect::friction;
  };
  if (!arguments.muscles || (!scene.model.muscles.empty() && !arguments.apart)) return scene;
  std::string effects = "muscles, tendon_coupling";
  for (int i = 0; i < model::kEffectCount; ++i)
    if (const auto effect = static_cast<Effect>(i);
        scene.spec.solver.effects.has(effect) && !(arguments.apart && touches(effect)))
      effects += fmt::format(", {}", model::name(effect));
  std::vector<std::string> overrides = arguments.overrides;
  overrides.push_back("effects=[" + effects + "]");
  return scene::load_scene(arguments.scene, overrides);
}

}  // namespace

study::InverseInput inverse_input(const InverseArguments& arguments) {
  study::InverseInput input;
  input.motion = arguments.motion;
  if (arguments.names) input.options.names = load_names(*arguments.names);
  input.options.clamp = arguments.clamp;
  input.options.filter = arguments.cutoff;
  input.loads = arguments.loads;
  input.forward = !arguments.no_check;
  if (arguments.muscles) input.least_activation = arguments.co_contraction;
  return input;
}

int inverse_command(const InverseArguments& arguments) {
  const scene::Scene scene = with_muscles(arguments);
  print_warnings(scene.warnings);
  const study::InverseInput input = inverse_input(arguments);
  const output::OutputFolder folder(arguments.out, study::inverse_files(), [&] {
    std::vector<std::filesystem::path> read = scene::files_read(scene);
    for (const auto& file : {arguments.motion, arguments.names, arguments.loads})
      if (file) read.push_back(*file);
    return read;
  });
  const study::InverseResult result =
      with_progress([&](const auto& show) { return study::run_inverse(scene, input, show); });
  print_warnings(result.warnings);
  folder.clear();
  study::StudyEnd end{scene.spec.title + "\n" + study::inverse_table(result)};
  end.plotted = study::write_inverse(scene, input, result, arguments.out);
  if (result.fault) print_error("the check ended early: {}\n", *result.fault);
  if (result.rms_error && !result.agrees() && !result.fault)
    print_error(
        "the check misses the motion: RMS error {:.3g} deg, limit {:g} deg: contacts between bodies are "
        "no part of the torques, and without feedback differences grow\n",
        kDegreesPerRadian * *result.rms_error, kDegreesPerRadian * study::kLargestCheckError);
  if (result.cutoff)
    end.text += fmt::format("filter: Butterworth, second order, forwards and backwards, cut-off {:g} Hz\n",
                            *result.cutoff);
  if (result.reserve_share)
    end.text +=
        fmt::format("muscles leave {:.2g} % of the torques undone (RMS over all axes): reserves.sto\n",
                    100 * *result.reserve_share);
  if (result.rms_error)
    end.text += fmt::format(
        "a simulation with these {}: RMS error {:.3g} deg over all axes\n",
        arguments.muscles
            ? fmt::format("excitations and reserves, from the motion anew each {:g} s", study::kCheckWindow)
            : "torques alone",
        kDegreesPerRadian * *result.rms_error);
  end.json = study::inverse_json(scene, input, result);
  const int status = print_study(end, arguments.out, arguments.json);
  return result.agrees() ? status : 1;
}

}  // namespace handsim::app
