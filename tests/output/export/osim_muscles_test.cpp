// Muscles in OpenSim's file, read by another XML reader. Oracle: the file's polynomials, evaluated here, are
// lengths of the model's tendons and their derivatives its moment arms.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <optional>
#include <pugixml.hpp>
#include <random>
#include <sstream>
#include <utility>

#include "handsim/model/kinematics.h"
#include "scene_files.h"
#include "support/written.h"

namespace handsim::test {
namespace {

using Powers = std::vector<int>;

/// OpenSim's MultivariatePolynomialFunction of a path.
struct Polynomial {
  std::vector<std::string> coordinates;
  std::map<Powers, double> terms;

  /// @param by variable to differentiate by; none: the value
  double at(const std::vector<double>& x, std::optional<std::size_t> by = std::nullopt) const {
    double out = 0;
    for (const auto& [powers, factor] : terms) {
      double term = factor;
      for (std::size_t i = 0; i < x.size(); ++i) {
        const int n = powers[i];
        term *= by == i ? (n == 0 ? 0 : n * std::pow(x[i], n - 1)) : std::pow(x[i], n);
      }
      out += term;
    }
    return out;
  }
};

template <class T>
std::vector<T> split(const std::string& text) {
  std::istringstream in(text);
  std::vector<T> out;
  for (T each; in >> each;) out.push_back(each);
  return out;
}

/// All powers of `count` variables with a sum of at most `order`: OpenSim's order is the one of a map's keys,
/// the last variable's fastest. Made once for each pair: many paths have the same.
std::map<Powers, double> all_powers(std::size_t count, int order) {
  static std::map<std::pair<std::size_t, int>, std::map<Powers, double>> known;
  std::map<Powers, double>& out = known[{count, order}];
  if (!out.empty()) return out;
  Powers each(count, 0);
  for (;;) {
    int sum = 0;
    for (const int power : each) sum += power;
    if (sum <= order) out[each] = 0;
    std::size_t i = 0;
    while (i < count && each[i] == order) each[i++] = 0;
    if (i == count) return out;
    ++each[i];
  }
}

Polynomial read(const pugi::xml_node& force) {
  Polynomial out;
  const pugi::xml_node path = force.child("FunctionBasedPath");
  const pugi::xml_node function = path.child("length_function").child("MultivariatePolynomialFunction");
  out.coordinates = split<std::string>(path.child_value("coordinate_paths"));
  EXPECT_EQ(function.child("dimension").text().as_uint(), out.coordinates.size()) << force.name();
  out.terms = all_powers(out.coordinates.size(), function.child("order").text().as_int());
  const std::vector<double> coefficients = split<double>(function.child_value("coefficients"));
  EXPECT_EQ(coefficients.size(), out.terms.size());
  std::size_t i = 0;
  for (auto& [powers, factor] : out.terms) factor = coefficients.at(i++);
  return out;
}

/// Forces of a kind by name.
std::map<std::string, pugi::xml_node> forces(const pugi::xml_document& file, const char* kind) {
  std::map<std::string, pugi::xml_node> out;
  for (const pugi::xml_node each :
       file.child("OpenSimDocument").child("Model").child("ForceSet").child("objects").children(kind))
    out[each.attribute("name").value()] = each;
  return out;
}

/// Places of coordinates in the file, by place in the vectors of the model.
std::vector<std::string> places(const model::Model& model) {
  std::vector<std::string> out;
  for (const model::Joint& joint : model.joints)
    for (const model::JointAxis& axis : joint.axes)
      out.push_back("/jointset/" + joint.name + "/" + joint.name + "." + axis.name);
  return out;
}

std::vector<double> drawn_pose(const model::Model& model, std::mt19937& random) {
  std::uniform_real_distribution<double> share(0, 1);
  std::vector<double> out;
  for (const model::Joint& joint : model.joints)
    for (const model::JointAxis& axis : joint.axes)
      out.push_back(axis.stop->low + share(random) * (axis.stop->high - axis.stop->low));
  return out;
}

/// Compares a path at a pose; welded coordinates are not in the file. Returns the arms seen. Bounds: rounding
/// of sums of a hundred terms.
int expect_path(const Polynomial& found, const model::TendonPath& path, double length,
                const std::vector<std::string>& names, const std::vector<double>& q, std::size_t welded,
                const std::string& of) {
  std::map<std::string, double> angle;
  for (std::size_t k = 0; k < names.size(); ++k) angle[names[k]] = q[k];
  std::vector<double> x;
  for (const std::string& each : found.coordinates) x.push_back(angle.at(each));
  const model::PathState expected = model::path_state(path, q);
  EXPECT_NEAR(found.at(x), length - expected.excursion, 1e-14) << of;
  EXPECT_EQ(found.coordinates.size() + welded, path.arms.size()) << of;
  for (std::size_t i = 0; i < x.size(); ++i)
    for (std::size_t a = 0; a < path.arms.size(); ++a)
      if (names[static_cast<std::size_t>(path.arms[a].dof)] == found.coordinates[i]) {
        EXPECT_NEAR(-found.at(x, i), expected.arm[a], 1e-14) << of << " " << found.coordinates[i];
      }
  return static_cast<int>(x.size());
}

scene::Scene hand() {
  return shipped_scene("resting_hand", {"effects=[joint_stops, muscles, tendon_coupling]"});
}

pugi::xml_document exported(const scene::Scene& scene) {
  pugi::xml_document out;
  EXPECT_TRUE(out.load_string(test::written("osim", scene.model, scene.spec.solver).c_str()));
  return out;
}

TEST(OsimMuscles, PolynomialsAreThePathsOfTheModel) {
  const scene::Scene scene = hand();
  const model::Model& model = scene.model;
  const pugi::xml_document file = exported(scene);
  const auto muscles = forces(file, "RigidTendonMuscle"), bands = forces(file, "ExpressionBasedPathForce");
  EXPECT_EQ(muscles.size(), model.muscles.size());
  EXPECT_EQ(bands.size(), model.bands.size());
  std::mt19937 random(3);
  int seen = 0;
  for (int pose = 0; pose < 10; ++pose) {
    const std::vector<double> q = drawn_pose(model, random);
    for (const model::Muscle& each : model.muscles)
      seen +=
          expect_path(read(muscles.at(each.name)), each.path, each.length, places(model), q, 0, each.name);
    for (const model::Band& each : model.bands)
      seen += expect_path(read(bands.at(each.name)), each.path, 0, places(model), q, 0, each.name);
  }
  EXPECT_GT(seen, 10 * 180);
}

TEST(OsimMuscles, HaveTheModelsNumbers) {
  const scene::Scene scene = hand();
  const pugi::xml_document file = exported(scene);
  const auto muscles = forces(file, "RigidTendonMuscle"), bands = forces(file, "ExpressionBasedPathForce");
  for (const model::Muscle& each : scene.model.muscles) {
    const pugi::xml_node found = muscles.at(each.name);
    EXPECT_EQ(found.child("max_isometric_force").text().as_double(), each.force);
    EXPECT_EQ(found.child("optimal_fiber_length").text().as_double(), each.fibre_length);
    EXPECT_EQ(found.child("tendon_slack_length").text().as_double(), each.slack_length);
    EXPECT_EQ(found.child("pennation_angle_at_optimal").text().as_double(), each.pennation);
    EXPECT_EQ(found.child("max_contraction_velocity").text().as_double(), each.max_speed);
  }
  for (const model::Band& each : scene.model.bands) {
    EXPECT_EQ(bands.at(each.name).child("resting_length").text().as_double(), each.rest);
    EXPECT_EQ(bands.at(each.name).child("clamp_stretch").text().as_bool(), !each.both_ways);
  }
}

// High powers, products of powers, and a finger whose last joint the file welds at the start.
TEST(OsimMuscles, TakePowersProductsAndWeldedJoints) {
  scene::Scene scene = hand();
  model::Model& model = scene.model;
  model::Muscle& muscle = model.muscles.front();
  ASSERT_EQ(muscle.path.arms.size(), 6U);
  muscle.path.arms[2].c = {0.01, -0.002, 0.003, 0.0005, -0.0007};
  muscle.path.products = {{0, 3, 2, 3, 0.0004}, {4, 5, 1, 2, -0.0006}, {2, 5, 1, 1, 0.0002}};
  std::vector<double> welded = model::initial_state(model).q;
  for (const model::Joint& joint : model.joints)
    if (joint.first_dof == muscle.path.arms[5].dof)
      model.bodies[static_cast<std::size_t>(joint.child)].kinematic = true;
  const pugi::xml_document file = exported(scene);
  const Polynomial found = read(forces(file, "RigidTendonMuscle").at(muscle.name));
  std::mt19937 random(3);
  for (int pose = 0; pose < 20; ++pose) {
    std::vector<double> q = drawn_pose(model, random);
    const auto dof = static_cast<std::size_t>(muscle.path.arms[5].dof);
    q[dof] = welded[dof];
    EXPECT_EQ(expect_path(found, muscle.path, muscle.length, places(model), q, 1, muscle.name), 5);
  }
}

TEST(OsimMuscles, AreLeftOutWithoutTheEffect) {
  const scene::Scene scene = shipped_scene("resting_hand", {"effects=[joint_stops]"});
  EXPECT_TRUE(forces(exported(scene), "RigidTendonMuscle").empty());
}

}  // namespace
}  // namespace handsim::test
