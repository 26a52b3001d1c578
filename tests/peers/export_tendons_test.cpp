// Exported muscles in MuJoCo: the same moment arms, and the same torques for constant activations.
#include <cmath>
#include <fstream>
#include <map>

#include <gtest/gtest.h>

#include <mujoco/mujoco.h>

#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::test {
namespace {

struct Loaded {
  scene::Scene scene;
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data{nullptr, mj_deleteData};
  std::map<int, int> dof_of;  ///< MuJoCo's, of ours
};

Loaded load() {
  Loaded out;
  out.scene =
      shipped_scene("resting_hand", {"effects=[joint_stops, passive_tissue, muscles, tendon_coupling]",
                                     "hands.0.pose={index_mcp: [0.6, 0.05], index_pip: 0.7, index_dip: 0.3, "
                                     "middle_pip: 1.1, thumb_mcp: 0.4, wrist: [0.3, -0.1]}"});
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "hand.xml").string();
  std::ofstream(path) << test::written("mjcf", out.scene.model, out.scene.spec.solver);
  char error[1000] = {};
  out.model.reset(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
  EXPECT_STREQ(error, "");
  if (!out.model) return out;
  out.data.reset(mj_makeData(out.model.get()));
  mj_resetDataKeyframe(out.model.get(), out.data.get(), 0);
  mj_forward(out.model.get(), out.data.get());
  for (const model::Joint& joint : out.scene.model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      const int id =
          mj_name2id(out.model.get(), mjOBJ_JOINT, (joint.name + "." + joint.axes[a].name).c_str());
      out.dof_of[joint.first_dof + static_cast<int>(a)] = out.model->jnt_dofadr[id];
    }
  return out;
}

// Oracle: MuJoCo's tendon Jacobian is minus the moment arms; its actuators' torques those of the muscles at
// rest.
TEST(MusclesInMujoco, HaveTheSameMomentArmsAndTorques) {
  Loaded in = load();
  ASSERT_TRUE(in.model);
  const model::Model& model = in.scene.model;
  const model::State state = model::initial_state(model);
  std::vector<double> torques(state.q.size());
  int seen = 0;
  for (std::size_t m = 0; m < model.muscles.size(); ++m) {
    const model::Muscle& muscle = model.muscles[m];
    const model::PathState path = model::path_state(muscle.path, state.q);
    const int tendon = mj_name2id(in.model.get(), mjOBJ_TENDON, muscle.name.c_str());
    const int actuator = mj_name2id(in.model.get(), mjOBJ_ACTUATOR, muscle.name.c_str());
    ASSERT_GE(tendon, 0) << muscle.name;
    ASSERT_GE(actuator, 0) << muscle.name;
    const double activation = 0.1 + 0.02 * static_cast<double>(m);
    // Activations stand last among the actuators.
    in.data->act[actuator - (in.model->nu - in.model->na)] = activation;
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i) {
      const int dof = in.dof_of.at(muscle.path.arms[i].dof);
      EXPECT_NEAR(in.data->ten_J[tendon * in.model->nv + dof], -path.arm[i],
                  1e-9 * std::abs(path.arm[i]) + 1e-15);
      torques[static_cast<std::size_t>(muscle.path.arms[i].dof)] +=
          path.arm[i] * model::tension(muscle, path.excursion, 0, activation).force;
      ++seen;
    }
  }
  EXPECT_GT(seen, 150);
  mj_forward(in.model.get(), in.data.get());
  for (const auto& [ours, theirs] : in.dof_of) {
    const double torque = torques[static_cast<std::size_t>(ours)];
    EXPECT_NEAR(in.data->qfrc_actuator[theirs], torque, 1e-9 * std::abs(torque) + 1e-12);
  }
}

// Oracle: the law of a band that works both ways, k (x - rest) r, in MuJoCo's passive forces.
TEST(MusclesInMujoco, HaveTheSameBands) {
  Loaded in = load();
  ASSERT_TRUE(in.model);
  const model::Model& model = in.scene.model;
  const model::State state = model::initial_state(model);
  for (const model::Band& band : model.bands) {
    const int id = mj_name2id(in.model.get(), mjOBJ_TENDON, band.name.c_str());
    ASSERT_GE(id, 0) << band.name;
    const model::PathState path = model::path_state(band.path, state.q);
    if (!band.both_ways) {
      EXPECT_NEAR(in.model->tendon_range[2 * id + 1] - in.data->ten_length[id], band.rest + path.excursion,
                  1e-12);
      continue;
    }
    const double tension = band.stiffness * (in.data->ten_length[id] - in.model->tendon_lengthspring[id]);
    EXPECT_NEAR(tension, band.stiffness * (-path.excursion - band.rest), 1e-9);
  }
}

}  // namespace
}  // namespace handsim::test
