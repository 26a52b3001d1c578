// Derivatives of steps of whole scenes, with control, tendons and contact, against Richardson differences of
// steps solved to rounding.
#include <gtest/gtest.h>

#include "engine/articulated/step_differences.h"
#include "handsim/environment/derivatives.h"
#include "handsim/scene/compile/scene.h"
#include "places.h"

namespace handsim::environment {
namespace {

using engine::articulated::test::Coordinates;
using engine::articulated::test::Difference;
using engine::articulated::test::error;
using engine::articulated::test::ridders;

class SceneSteps {
 public:
  SceneSteps(const std::string& file, const std::vector<std::string>& overrides, double until)
      : scene_(
            std::make_shared<scene::Scene>(scene::load_scene(test::in_source("config/") + file, overrides))),
        simulation_(scene_, simulation::no_watchers),
        coordinates(scene_->model) {
    while (simulation_.state().time < until) simulation_.step();
    base_ = simulation_.state();
  }
  Derivatives derivatives(const DerivativesAsked& asked = {}) {
    simulation_.reset(base_);
    Derivatives out = step_with_derivatives(
        simulation_, [&] { step(); }, asked);
    reference_ = simulation_.state();
    return out;
  }
  Eigen::VectorXd next(const Eigen::VectorXd& change) {
    simulation_.reset(coordinates.moved(base_, change));
    step_with_derivatives(simulation_, [&] { step(); }, {{}, !excitations.empty(), true});
    return coordinates.apart(simulation_.state(), reference_);
  }
  Eigen::VectorXd next() { return next(Eigen::VectorXd::Zero(2 * coordinates.size())); }
  const model::State& base() const { return base_; }
  const simulation::Simulation& simulation() const { return simulation_; }
  std::string name(int coordinate) const {
    for (const model::Joint& joint : scene_->model.joints)
      if (coordinate >= joint.first_dof && coordinate < joint.first_dof + dof_count(joint.kind))
        return joint.name + "." + joint.axes[as_index(coordinate - joint.first_dof)].name;
    return "a free body";
  }

 private:
  void step() {
    engine::StepInput input;
    input.torques = torques;
    input.excitations = excitations;
    simulation_.step(input, targets);
  }
  std::shared_ptr<scene::Scene> scene_;
  simulation::Simulation simulation_;
  model::State base_, reference_;

 public:
  Coordinates coordinates;
  std::vector<double> torques, excitations, targets;
};

/// Largest error of all columns by state where differences know better than 1e-8.
double state_error(SceneSteps& of) {
  const Derivatives found = of.derivatives({{}, !of.excitations.empty(), false});
  for (const std::string& note : found.notes) std::printf("  %s\n", note.c_str());
  double most = 0;
  const int n = of.coordinates.size();
  int known = 0;
  for (int j = 0; j < 2 * n; ++j) {
    const Difference oracle = ridders(j < n ? 2e-5 : 2e-4, [&](double by) {
      Eigen::VectorXd change = Eigen::VectorXd::Zero(2 * n);
      change[j] = by;
      return of.next(change);
    });
    const double e = error(found.by_state.col(j), oracle.value);
    const auto names = [&](const std::string& note) { return j < n && note.starts_with(of.name(j) + ":"); };
    if (oracle.error > 3e-8 || std::ranges::any_of(found.notes, names)) continue;
    ++known;
    most = std::max(most, e);
  }
  std::printf("  %d contacts, largest error %.3g of %d of %d columns\n",
              of.simulation().last_report().contacts, most, known, 2 * n);
  EXPECT_GE(known, 2 * n * 9 / 10);
  return most;
}

TEST(SceneDerivatives, OfAHandThatMovesAreThoseOfDifferences) {
  SceneSteps of("every_pose.yaml", {"solver.engine=articulated"}, 0.35);
  EXPECT_LT(state_error(of), 1e-7);
}

TEST(SceneDerivatives, OfAHeldCardAreThoseOfDifferences) {
  SceneSteps of("grasp_pinch.yaml", {"solver={engine: articulated}"}, 2.5);
  EXPECT_LT(state_error(of), 1e-7);
}

TEST(SceneDerivatives, OfAHeldMugAreThoseOfDifferences) {
  SceneSteps of("grasp_cup.yaml", {"solver={engine: articulated}"}, 2.5);
  EXPECT_LT(state_error(of), 1e-7);
}

/// Largest error of derivatives by numbers of an action.
double action_error(SceneSteps& of, std::vector<double>& action, Eigen::MatrixXd Derivatives::*by, double h) {
  const Eigen::MatrixXd found = of.derivatives({{}, !of.excitations.empty(), false}).*by;
  double most = 0;
  for (std::size_t j = 0; j < action.size(); ++j) {
    const double kept = action[j];
    const Difference oracle = ridders(h, [&](double change) {
      action[j] = kept + change;
      return of.next();
    });
    action[j] = kept;
    most = std::max(most, error(found.col(static_cast<Eigen::Index>(j)), oracle.value));
  }
  return most;
}

TEST(SceneDerivatives, ByTorquesAndTargetsAreThoseOfDifferences) {
  for (const char* scene : {"every_pose.yaml", "grasp_pinch.yaml"}) {
    SceneSteps of(scene, {"solver={engine: articulated}"}, 1.6);
    of.torques.resize(as_index(of.simulation().model().dof_count()));
    EXPECT_LT(action_error(of, of.torques, &Derivatives::by_torque, 1e-4), 1e-7) << scene;
    for (const control::DrivenAxis& axis : of.simulation().scene().control->axes)
      of.targets.push_back(of.base().q[axis.dof] + 0.01);
    EXPECT_LT(action_error(of, of.targets, &Derivatives::by_target, 1e-4), 1e-7) << scene;
  }
}

TEST(SceneDerivatives, ByExcitationsAreThoseOfDifferences) {
  SceneSteps of("muscle_poses.yaml", {}, 0.35);
  of.excitations.assign(of.simulation().model().muscles.size(), 0.2);
  EXPECT_LT(action_error(of, of.excitations, &Derivatives::by_excitation, 1e-3), 1e-7);
}

TEST(SceneDerivatives, OfMusclesAreThoseOfDifferences) {
  SceneSteps of("muscle_poses.yaml", {}, 0.35);
  of.excitations.assign(of.simulation().model().muscles.size(), 0.2);
  EXPECT_LT(state_error(of), 1e-7);
}

}  // namespace
}  // namespace handsim::environment
