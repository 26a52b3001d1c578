#include "handsim/core/data_folder.h"
#include "handsim/output/output_folder.h"
#include "handsim/python/bindings.h"
#include "handsim/python/signals.h"
#include "handsim/study/accuracy/accuracy.h"
#include "handsim/study/effects/contact_cost.h"
#include "handsim/study/effects/effects.h"
#include "handsim/study/grasp/agreement.h"
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/rollouts/rollouts.h"
#include "handsim/study/stability/stability.h"

namespace handsim::python {

namespace {

using std::filesystem::path;

// Each study writes the files of its command into a folder, and returns the text that the command prints: the
// Python side reads its tables from the files.

std::string accuracy(const path& study, const path& out, const std::optional<path>& peers,
                     const py::object& progress) {
  return run_study(progress, [&](StudyHooks& hooks) {
    study::AccuracySpec spec = study::load_accuracy(study);
    spec.peers = peers;
    const output::OutputFolder folder(out, study::accuracy_files());
    const study::AccuracyResult result = study::run_accuracy(spec, hooks.told);
    folder.clear();
    study::write_accuracy(spec, result, out);
    return study::accuracy_table(result, spec.early);
  });
}

std::string effects_study(const SceneHandle& of, const path& out, int repeats, const py::object& progress) {
  return run_study(progress, [&](StudyHooks& hooks) {
    const output::OutputFolder folder(out, study::effects_files());
    const study::EffectsResult result = study::run_effects(*of.scene, repeats, hooks.told);
    folder.clear();
    study::write_effects(*of.scene, result, out);
    return study::effects_table(result);
  });
}

std::string contacts(const path& out, const py::object& progress) {
  return run_study(progress, [&](StudyHooks& hooks) {
    const output::OutputFolder folder(out, study::contact_cost_files());
    const auto rows = study::run_contact_cost(data_folder(), hooks.told);
    folder.clear();
    study::write_contact_cost(rows, out);
    return study::contact_cost_table(rows);
  });
}

std::string stability(const path& study, const path& out, const std::vector<std::string>& cases, bool quick,
                      int threads, bool pictures, const py::object& progress) {
  return run_study(progress, [&](StudyHooks& hooks) {
    const study::StabilitySpec spec = study::load_stability(study);
    const output::OutputFolder folder(out, study::stability_files(spec));
    study::StabilityOptions options;
    options.cases = cases;
    options.quick = quick;
    options.threads = threads;
    options.progress = hooks.told;
    const study::StabilityResult result = study::run_stability(spec, options);
    folder.clear();
    study::write_stability(spec, result, out);
    if (pictures)
      if (const auto failure = study::draw_stability(result, out))
        throw output_error(out.string(), "no pictures: " + *failure, "memory, and room on the disk");
    return study::stability_table(result);
  });
}

/// @return whether every criterion held
bool grasps(const std::vector<path>& scenes, const path& out, const std::vector<std::string>& sides,
            const std::vector<std::string>& overrides, std::optional<double> friction, bool friction_search,
            bool margin, bool pictures, const py::object& progress) {
  return run_study(progress, [&](StudyHooks& hooks) {
    study::GraspStudy study;
    study.scenes = scenes;
    study.out = out;
    study.sides = sides;
    study.overrides = overrides;
    study.friction = friction;
    study.friction_search = friction_search;
    study.margin = margin;
    study.pictures = pictures;
    study.progress = hooks.told;
    const study::GraspTables tables = study::run_grasps(study);
    return tables.passed() && tables.missing.empty();
  });
}

void agreement(const path& scene, const path& out, const std::vector<std::string>& overrides, int draws,
               std::uint64_t seed, int quarter_steps, int threads, const py::object& progress) {
  run_study(progress, [&](StudyHooks& hooks) {
    study::AgreementStudy study;
    study.scene = scene;
    study.out = out;
    study.overrides = overrides;
    study.draws = draws;
    study.seed = seed;
    study.quarter_steps = quarter_steps;
    study.threads = threads;
    study.progress = hooks.told;
    study::run_agreement(study);
    return 0;
  });
}

std::string rollouts(const path& file, const path& out, std::optional<int> count, std::optional<int> seed,
                     const std::vector<std::string>& overrides, int threads, bool resume,
                     const py::object& progress) {
  return run_study(progress, [&](StudyHooks& hooks) {
    study::RolloutsSpec spec = study::load_rollouts(file);
    spec.set.insert(spec.set.end(), overrides.begin(), overrides.end());
    spec.count = count.value_or(spec.count);
    spec.seed = seed.value_or(spec.seed);
    study::RolloutOptions options;
    options.out = out;
    options.threads = threads;
    options.resume = resume;
    // The study ends by `stop`, not by an exception.
    options.progress = [&hooks](double share) { hooks.share = share; };
    const study::RolloutStudy study(std::move(spec));
    const output::OutputFolder folder(out, study::rollout_files());
    study::Ranks alone;
    const study::RolloutsResult result =
        study::run_rollouts(study, options, alone, hooks.stop, [&] { folder.clear(); });
    return result.done < result.size ? std::string() : study::rollouts_screen(result.table);
  });
}

}  // namespace

void bind_studies(py::module_& module) {
  module.def("accuracy", &accuracy, py::arg("study"), py::arg("out"), py::arg("peers"), py::arg("progress"));
  module.def("effects", &effects_study, py::arg("scene"), py::arg("out"), py::arg("repeats"),
             py::arg("progress"));
  module.def("contacts", &contacts, py::arg("out"), py::arg("progress"));
  module.def("stability", &stability, py::arg("study"), py::arg("out"), py::arg("cases"), py::arg("quick"),
             py::arg("threads"), py::arg("pictures"), py::arg("progress"));
  module.def("grasps", &grasps, py::arg("scenes"), py::arg("out"), py::arg("sides"), py::arg("overrides"),
             py::arg("friction"), py::arg("friction_search"), py::arg("margin"), py::arg("pictures"),
             py::arg("progress"));
  module.def("agreement", &agreement, py::arg("scene"), py::arg("out"), py::arg("overrides"),
             py::arg("draws"), py::arg("seed"), py::arg("quarter_steps"), py::arg("threads"),
             py::arg("progress"));
  module.def("rollouts", &rollouts, py::arg("study"), py::arg("out"), py::arg("count"), py::arg("seed"),
             py::arg("overrides"), py::arg("threads"), py::arg("resume"), py::arg("progress"));
}

}  // namespace handsim::python
