// Exported muscles in OpenSim (PyPI: opensim). Oracle: the moment arms, lengths and tensions of the model.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>

#include "handsim/model/muscle_curves.h"
#include "output/export/opensim.h"
#include "support/written.h"

namespace handsim::test {
namespace {

constexpr int kPoses = 20;

/// Coordinates, rates and activations, in the order of the model.
struct Sample {
  std::vector<double> q, u, activation;
};

std::vector<std::string> coordinate_names(const model::Model& model) {
  std::vector<std::string> out;
  for (const model::Joint& joint : model.joints)
    for (const model::JointAxis& axis : joint.axes) out.push_back(joint.name + "." + axis.name);
  return out;
}

/// Poses between the stops. @param fastest rate [rad/s]
std::vector<Sample> samples(const model::Model& model, double fastest, bool full) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<Sample> out(kPoses);
  for (Sample& sample : out) {
    for (const model::Joint& joint : model.joints)
      for (const model::JointAxis& axis : joint.axes) {
        sample.q.push_back(axis.stop->low + share(random) * (axis.stop->high - axis.stop->low));
        sample.u.push_back(fastest * (2 * share(random) - 1));
      }
    for (std::size_t i = 0; i < model.muscles.size(); ++i)
      sample.activation.push_back(full ? 1 : share(random));
  }
  return out;
}

scene::Scene hand(const std::string& effects) {
  return shipped_scene("resting_hand", {"effects=" + effects});
}

json ask(const model::Model& model, const engine::Settings& settings, const std::vector<Sample>& samples) {
  const TemporaryFolder folder;
  std::ofstream(folder.path() / "model.osim") << test::written("osim", model, settings);
  json question = {{"names", coordinate_names(model)},
                   {"samples", json::array()},
                   {"times", json::array()},
                   {"kinematics", false}};
  for (const Sample& sample : samples) {
    json activations = json::object();
    for (std::size_t i = 0; i < model.muscles.size(); ++i)
      activations[model.muscles[i].name] = sample.activation[i];
    question["samples"].push_back({{"q", sample.q},
                                   {"u", sample.u},
                                   {"du", std::vector<double>(sample.q.size(), 0.0)},
                                   {"activations", activations}});
  }
  std::ofstream(folder.path() / "motion.json") << question;
  return opensim_answer(folder.path());
}

/// Largest differences: lengths relative; arms over the tendon's largest; rates over the fastest; tensions
/// over the muscle's strength; torques over the largest.
struct MuscleAgreement {
  double length = 0, arm = 0, rate = 0, tension = 0, torque = 0;
  int arms = 0;
};

void raise(double& to, double value) { to = std::max(to, std::abs(value)); }

double rate_of(const model::TendonPath& path, const model::PathState& state, const std::vector<double>& u) {
  double out = 0;
  for (std::size_t i = 0; i < path.arms.size(); ++i)
    out -= state.arm[i] * u[static_cast<std::size_t>(path.arms[i].dof)];
  return out;
}

void compare_muscle(const model::Muscle& muscle, const Sample& sample, double activation,
                    const std::vector<std::string>& names, const json& found, std::vector<double>& torques,
                    MuscleAgreement& out) {
  const model::PathState path = model::path_state(muscle.path, sample.q);
  const double rate = rate_of(muscle.path, path, sample.u);
  const double tension = model::tension(muscle, path.excursion, rate, activation).force;
  double largest = 0;
  for (std::size_t i = 0; i < muscle.path.arms.size(); ++i) raise(largest, path.arm[i]);
  EXPECT_EQ(found["arms"].size(), muscle.path.arms.size()) << muscle.name;
  for (std::size_t i = 0; i < muscle.path.arms.size(); ++i) {
    const auto dof = static_cast<std::size_t>(muscle.path.arms[i].dof);
    raise(out.arm, (found["arms"][names[dof]].get<double>() - path.arm[i]) / largest);
    torques[dof] += path.arm[i] * tension;
    ++out.arms;
  }
  raise(out.length, found["length"].get<double>() / (muscle.length - path.excursion) - 1);
  raise(out.rate, (found["rate"].get<double>() - rate) / (muscle.max_speed * muscle.fibre_length));
  raise(out.tension, (found["tension"].get<double>() - tension) / muscle.force);
}

MuscleAgreement agreement(const model::Model& model, const std::vector<Sample>& samples, const json& found) {
  MuscleAgreement out;
  const std::vector<std::string> names = coordinate_names(model);
  double largest = 0;
  for (std::size_t s = 0; s < samples.size(); ++s) {
    std::vector<double> torques(names.size());
    for (std::size_t i = 0; i < model.muscles.size(); ++i)
      compare_muscle(model.muscles[i], samples[s], samples[s].activation[i], names,
                     found["muscles"][s][model.muscles[i].name], torques, out);
    // What OpenSim's inverse dynamics wants for a hand that stays at rest.
    for (std::size_t k = 0; k < names.size(); ++k) {
      raise(largest, torques[k]);
      raise(out.torque, found["torques"][s][names[k]].get<double>() + torques[k]);
    }
  }
  out.torque /= largest;
  return out;
}

/// Torques of bands at a pose and rates.
std::vector<double> band_torques(const model::Model& model, const Sample& sample, int& taut) {
  std::vector<double> out(sample.q.size());
  for (const model::Band& band : model.bands) {
    const model::PathState path = model::path_state(band.path, sample.q);
    const double x = -path.excursion - band.rest;
    double force = band.stiffness * x + band.damping * rate_of(band.path, path, sample.u);
    if (!band.both_ways) {
      force = x > 0 ? std::max(0.0, force) : 0;
      taut += x > 0;
    }
    for (std::size_t i = 0; i < band.path.arms.size(); ++i)
      out[static_cast<std::size_t>(band.path.arms[i].dof)] += path.arm[i] * force;
  }
  return out;
}

class MusclesInOpenSim : public testing::Test {
 protected:
  void SetUp() override {
    if (!opensim_is_there()) GTEST_SKIP() << kNoOpenSim;
  }
};

// Bound: 1e-6 relative, as asked; rounding is 1e-15.
TEST_F(MusclesInOpenSim, LengthsArmsAndTensionsAtRestAreTheModels) {
  const scene::Scene scene = hand("[joint_stops, muscles]");
  const std::vector<Sample> asked = samples(scene.model, 0, false);
  const json found = ask(scene.model, scene.spec.solver, asked);
  ASSERT_FALSE(found.is_null());
  EXPECT_EQ(found["warnings"], json::array());
  const MuscleAgreement result = agreement(scene.model, asked, found);
  std::printf("OpenSim %s, %zu muscles at rest: lengths %.1e, arms %.1e, tensions %.1e, torques %.1e\n",
              found["version"].get<std::string>().c_str(), scene.model.muscles.size(), result.length,
              result.arm, result.tension, result.torque);
  EXPECT_GT(result.arms, 150 * kPoses);
  EXPECT_LT(result.length, 1e-6);
  EXPECT_LT(result.arm, 1e-6);
  EXPECT_LT(result.tension, 1e-6);
  EXPECT_LT(result.torque, 1e-6);
}

// OpenSim's muscle has one curve of the speed, written at full activation, takes the speed along the tendon
// and knows no damping of the passive part: the same law without pennation, below the optimal length.
TEST_F(MusclesInOpenSim, SpeedsActAsAtFullActivation) {
  scene::Scene scene = hand("[joint_stops, muscles]");
  const std::vector<Sample> asked = samples(scene.model, 5, true);
  const MuscleAgreement shipped = agreement(scene.model, asked, ask(scene.model, scene.spec.solver, asked));
  const std::vector<Sample> partly = samples(scene.model, 5, false);
  const MuscleAgreement partial = agreement(scene.model, partly, ask(scene.model, scene.spec.solver, partly));
  std::printf(
      "OpenSim, muscles moving: rates %.1e, tensions at full activation %.1e, at any activation %.1e\n",
      shipped.rate, shipped.tension, partial.tension);
  EXPECT_LT(shipped.rate, 1e-6);
  for (model::Muscle& muscle : scene.model.muscles) muscle.pennation = 0;
  const json found = ask(scene.model, scene.spec.solver, asked);
  ASSERT_FALSE(found.is_null());
  int seen = 0;
  for (std::size_t s = 0; s < asked.size(); ++s)
    for (const model::Muscle& muscle : scene.model.muscles) {
      const model::PathState path = model::path_state(muscle.path, asked[s].q);
      if (model::fibre_at(muscle, path.excursion).length > muscle.fibre_length) continue;
      const double rate = rate_of(muscle.path, path, asked[s].u);
      EXPECT_NEAR(found["muscles"][s][muscle.name]["tension"].get<double>(),
                  model::tension(muscle, path.excursion, rate, 1).force, 1e-9 * muscle.force)
          << muscle.name;
      ++seen;
    }
  EXPECT_GT(seen, 200);
}

// Oracle: the bands' law; what inverse dynamics wants more without them than with them.
TEST_F(MusclesInOpenSim, BandsPullAsTheModels) {
  const scene::Scene with = hand("[joint_stops, tendon_coupling]"), without = hand("[joint_stops]");
  const std::vector<Sample> asked = samples(with.model, 5, false);
  const json bands = ask(with.model, with.spec.solver, asked);
  const json none = ask(without.model, without.spec.solver, asked);
  ASSERT_FALSE(bands.is_null() || none.is_null());
  EXPECT_EQ(bands["warnings"], json::array());
  const std::vector<std::string> names = coordinate_names(with.model);
  double largest = 0, apart = 0;
  int taut = 0;
  for (std::size_t s = 0; s < asked.size(); ++s) {
    const std::vector<double> torques = band_torques(with.model, asked[s], taut);
    for (std::size_t k = 0; k < names.size(); ++k) {
      raise(largest, torques[k]);
      raise(apart, none["torques"][s][names[k]].get<double>() - bands["torques"][s][names[k]].get<double>() -
                       torques[k]);
    }
  }
  EXPECT_GT(taut, 0);  // of those that go slack
  EXPECT_GT(largest, 0.01);
  EXPECT_LT(apart, 1e-9 * largest);
}

}  // namespace
}  // namespace handsim::test
