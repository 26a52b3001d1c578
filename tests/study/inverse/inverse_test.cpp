#include "handsim/study/inverse/inverse.h"

#include <gtest/gtest.h>

#include <fstream>
#include <numeric>
#include <set>

#include "handsim/control/joint_space.h"
#include "handsim/control/muscle_drive.h"
#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/study/rollouts/rollouts.h"
#include "scene_files.h"
#include "smooth_motion.h"

namespace handsim::study {
namespace {

/// Two hands with moving wrists, without their own control.
scene::Scene hands(const std::vector<std::string>& more = {}) {
  std::vector<std::string> all = {"criteria={}"};
  all.insert(all.end(), more.begin(), more.end());
  return test::shipped_scene("every_pose", all);
}

InverseInput smooth_input(const scene::Scene& scene, const test::TemporaryFolder& folder) {
  InverseInput input;
  input.motion = folder.path() / "motion.csv";
  test::write_smooth_motion(*input.motion, scene.model);
  input.options.filter = 6;
  return input;
}

// Oracle: the motion itself. A simulation with the torques alone, without any feedback, stays on it for five
// seconds; the bound is the goal.
TEST(Inverse, ForwardSimulationReturnsToTheMotion) {
  const test::TemporaryFolder folder;
  for (const char* engine : {"solver.engine=ode", "solver.engine=articulated"}) {
    const scene::Scene scene = hands({"solver={}", engine, "solver.step=1 ms"});
    const InverseResult result = run_inverse(scene, smooth_input(scene, folder));
    ASSERT_FALSE(result.fault) << *result.fault;
    EXPECT_EQ(result.rows.size(), 5000U);
    ASSERT_TRUE(result.rms_error);
    EXPECT_LT(*result.rms_error, 0.01 * kDegree) << engine;
    EXPECT_GT(result.axes[4].largest_torque, 0.005) << result.axes[4].name;
  }
}

// Oracle: the motion itself. Resting muscles and bands pull in the simulation, so that the torques must not
// have their part: without it joints end up to 60 deg away. The bound is that without muscles.
TEST(Inverse, ForwardSimulationReturnsToTheMotionBesideMuscles) {
  const test::TemporaryFolder folder;
  const std::vector<std::vector<std::string>> kinds = {
      {"solver={engine: articulated, method: semi_implicit_euler, step: 1 ms}"},
      {"solver={engine: articulated, method: semi_implicit_euler, step: 1 ms}",
       "hands.0.tendon_strain=0.049"},
      {"solver={engine: ode, method: world_step, step: 1 ms}"}};
  for (std::vector<std::string> changes : kinds) {
    changes.insert(changes.end(), {"duration=2 s", "criteria={}"});
    const scene::Scene scene = test::shipped_scene("muscle_poses", changes);
    const InverseResult result = run_inverse(scene, {});
    EXPECT_TRUE(result.agrees());
    ASSERT_TRUE(result.rms_error);
    // ODE solves tendons by single joints, with angles of bodies that its joints hold apart: only the limit
    // of the check.
    if (changes[0].find("articulated") != std::string::npos) {
      EXPECT_LT(*result.rms_error, 0.01 * kDegree) << changes[0];
    }
  }
}

// Oracles: the motion itself, to which a simulation by excitations and reserves returns; the law of
// activation; torques, of which muscles leave little undone in a slow motion; and a least sum of squares,
// which no small change that keeps the torques makes less.
TEST(Inverse, ActivationsGiveTheTorquesAndReservesTheRest) {
  const scene::Scene scene = test::shipped_scene(
      "muscle_poses", {"solver={engine: articulated, method: semi_implicit_euler, step: 1 ms}",
                       "duration=1 s", "criteria={}"});
  InverseInput input;
  for (const double least : {0.0, 0.01}) {
    input.least_activation = least;
    const InverseResult result = run_inverse(scene, input);
    EXPECT_TRUE(result.agrees());
    ASSERT_TRUE(result.rms_error);
    EXPECT_LT(*result.rms_error, 0.01 * kDegree);
    double torque = 0, reserve = 0;
    for (const InverseAxis& axis : result.axes) {
      reserve += *axis.rms_reserve * *axis.rms_reserve;
      torque += axis.rms_torque * axis.rms_torque;
    }
    if (least == 0) {
      EXPECT_LT(std::sqrt(reserve / torque), 0.1);
    }
    for (std::size_t n = 1; n < result.rows.size(); n += 50)
      for (std::size_t m = 0; m < scene.model.muscles.size(); ++m) {
        const InverseRow &before = result.rows[n - 1], &row = result.rows[n];
        EXPECT_GE(row.excitation[m], 0);
        EXPECT_LE(row.excitation[m], 1);
        EXPECT_DOUBLE_EQ(row.activation[m],
                         model::next_activation(scene.model.muscles[m], before.activation[m],
                                                row.excitation[m], scene.spec.solver.step));
      }
  }
  EXPECT_THROW(run_inverse(hands(), input), Error);
}

// Oracle: bounds and optimality (Karush, Kuhn, Tucker): activations off their bounds are a combination of the
// rows of arms, as at the least sum of squares under given torques; the others want beyond their bound.
TEST(StaticOptimisation, IsTheLeastSumOfSquares) {
  const scene::Scene scene =
      test::shipped_scene("muscle_poses", {"duration=0.1 s", "hands.0.without=[spill]"});
  std::vector<std::size_t> dofs(as_index(scene.model.dof_count()));
  std::iota(dofs.begin(), dofs.end(), 0);
  const model::State state = model::initial_state(scene.model);
  std::vector<double> torques(dofs.size());
  for (std::size_t i = 0; i < dofs.size(); ++i) torques[i] = 0.01 * std::sin(1.0 + static_cast<double>(i));
  for (const double least : {0.0, 0.02}) {
    control::StaticOptimisation optimisation(scene.model, dofs, least);
    const std::span<const double> found = optimisation.solve(state, torques);
    const auto rows = static_cast<Eigen::Index>(dofs.size()),
               muscles = static_cast<Eigen::Index>(found.size());
    Eigen::MatrixXd arms = Eigen::MatrixXd::Zero(rows, muscles);
    for (Eigen::Index m = 0; m < muscles; ++m) {
      const model::Muscle& muscle = scene.model.muscles[as_index(static_cast<int>(m))];
      const model::PathState path = model::path_state(muscle.path, state.q);
      for (std::size_t i = 0; i < muscle.path.arms.size(); ++i)
        arms(muscle.path.arms[i].dof, m) = path.arm[i] * model::isometric_force(muscle, path.excursion);
    }
    std::vector<Eigen::Index> free;
    Eigen::VectorXd a(muscles);
    for (Eigen::Index m = 0; m < muscles; ++m) {
      a[m] = found[as_index(static_cast<int>(m))];
      EXPECT_GE(a[m], least);
      EXPECT_LE(a[m], 1);
      if (a[m] > least && a[m] < 1) free.push_back(m);
    }
    ASSERT_GT(free.size(), 5U);
    // The weight of a missing torque, over the coordinate's largest one.
    Eigen::VectorXd weights(rows);
    for (Eigen::Index i = 0; i < rows; ++i) {
      const double most = arms.row(i).cwiseAbs().sum();
      weights[i] = most > 0 ? 1e6 * optimisation.missing()[as_index(static_cast<int>(i))] / (most * most) : 0;
    }
    for (Eigen::Index m = 0; m < muscles; ++m) {
      const double wants = arms.col(m).dot(weights);
      if (a[m] <= least)
        EXPECT_LT(wants, least + 1e-6) << m;
      else if (a[m] < 1)
        EXPECT_NEAR(wants, a[m], 1e-6) << m;
      else
        EXPECT_GT(wants, 1 - 1e-6) << m;
    }
  }
}

// Oracle: what was not simulated was not measured, and more than the limit is no agreement.
TEST(Inverse, AnErrorOfTheCheckIsAVerdictAndAnOmittedOneIsNoZero) {
  const test::TemporaryFolder folder;
  const scene::Scene scene = hands();
  InverseInput input = smooth_input(scene, folder);
  input.forward = false;
  InverseResult result = run_inverse(scene, input);
  EXPECT_FALSE(result.rms_error);
  EXPECT_TRUE(result.agrees());
  result.rms_error = 1.01 * kLargestCheckError;
  EXPECT_FALSE(result.agrees());
}

// Oracle: statics. Hands at rest need the torque of their weight, which the gravity compensation of the
// controller computes in another way, less that of their tissue.
TEST(Inverse, HandsAtRestNeedTheirWeightAndTissue) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "rest.csv") << "time[s],index_mcp.flexion[deg]\n0,20\n0.1,20\n";
  const scene::Scene scene = hands();
  InverseInput input;
  input.motion = folder.path() / "rest.csv";
  input.forward = false;
  const InverseResult result = run_inverse(scene, input);
  const InverseRow& row = result.rows[50];
  model::State state = model::initial_state(scene.model);
  model::place_joints(scene.model, row.q, std::vector<double>(row.q.size(), 0.0), state);
  control::GravityLoad load(scene.model, scene.model.gravity);
  const std::span<const double> weight = load.torques(state);
  for (const InverseAxis& axis : result.axes) {
    EXPECT_NEAR(row.moment[axis.dof], weight[axis.dof], 1e-12) << axis.name;
    if (axis.name == "right.index_mcp.flexion") {
      EXPECT_NEAR(row.passive[axis.dof], -0.039 * (20 - 45) * kDegree, 1e-12);
    }
  }
}

// Oracle: a force at a point of the fingertip changes the torques by minus its moment about each axis.
TEST(Inverse, LoadsActWithTheirMoments) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "rest.csv") << "time[s],index_mcp.flexion[deg]\n0,0\n0.1,0\n";
  std::ofstream(folder.path() / "loads.csv")
      << "time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]\n"
      << "0,right.index_distal,0.1,0.05,0.2,1,2,3\n";
  const scene::Scene scene = hands();
  InverseInput input;
  input.motion = folder.path() / "rest.csv";
  input.forward = false;
  const InverseResult without = run_inverse(scene, input);
  input.loads = folder.path() / "loads.csv";
  const InverseResult with = run_inverse(scene, input);
  const model::State state = model::state_at(scene.model, with.rows[9].q);
  std::size_t moved = 0;
  for (const model::Joint& joint : scene.model.joints) {
    const auto dof = static_cast<std::size_t>(joint.first_dof);
    const model::BodyState& parent = state.bodies[static_cast<std::size_t>(joint.parent)];
    const Vec3 anchor = parent.pose() * joint.parent_frame.p;
    const Vec3 axis = parent.q * (joint.parent_frame.q * joint.axes[0].axis);
    const bool loaded = joint.name.starts_with("right.index_");
    const double moment = loaded ? (Vec3(0.1, 0.05, 0.2) - anchor).cross(Vec3(1, 2, 3)).dot(axis) : 0;
    EXPECT_NEAR(with.rows[9].moment[dof] - without.rows[9].moment[dof], -moment, 1e-12) << joint.name;
    moved += loaded ? 1 : 0;
  }
  EXPECT_EQ(moved, 3U);
  std::ofstream(folder.path() / "loads.csv")
      << "time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]\n"
      << "0,right.index_dital,0,0,0,1,2,3\n";
  EXPECT_THROW(run_inverse(scene, input), Error);
}

// Oracle: inverse dynamics of each drawn hand by itself.
TEST(Inverse, DrawnHandsHaveTheTorquesAndCurvesOfTheirOwn) {
  InverseInput input;
  input.forward = false;
  const RolloutStudy study(
      uncertain_inverse(test::source("config/every_pose.yaml"), {"duration=0.3 s", "criteria={}"}, input, 3));
  const std::atomic<bool> stop = false;
  const std::string name = "right.index_mcp.flexion";
  const auto place = [](const auto& list, const auto& of) {
    return std::ranges::find(list, of) - list.begin();
  };
  std::vector<std::string> columns;
  for (const Column& column : study.head().columns) columns.push_back(column.name);
  std::set<double> largest;
  for (long i = 0; i < 3; ++i) {
    const InverseResult own = run_inverse(study.scene(i), input);
    const auto axis = std::ranges::find(own.axes, name, &InverseAxis::name);
    const auto row = study.run(i, stop);
    EXPECT_EQ(std::get<double>(row->cells[as_index(place(columns, name + ".largest_torque[N_m]"))]),
              axis->largest_torque);
    largest.insert(axis->largest_torque);
    const std::size_t width = row->curves.columns.size();
    EXPECT_EQ(row->curves.values[2 * width + as_index(place(row->curves.columns, name + ".torque[N_m]"))],
              own.rows[2].active(axis->dof));
  }
  EXPECT_EQ(largest.size(), 3U) << "hands differ";
}

}  // namespace
}  // namespace handsim::study
