// What a run says of contacts: contacts.csv, sums in the summary, arrows.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>

#include <nlohmann/json.hpp>

#include "handsim/simulation/run/pictures.h"
#include "handsim/simulation/run/run.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::simulation {
namespace {

using nlohmann::json;

constexpr double kGravity = 9.80665;

/// A mug on a block on the ground, a ball in a palm that faces up.
scene::Scene still_life(const std::string& rest) {
  return scene::compile_scene(parse_yaml(
      "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: right, wrist: "
      "{mount: fixed, position: [0, 0, 0.3]}}]\n"
      "objects:\n"
      "  - {name: block, shape: box, edges: [0.09, 0.09, 0.05], mass: 0.3, position: [0.3, 0, 0.025]}\n"
      "  - {name: mug, file: objects/mug.yaml, position: [0.3, 0, 0.0905]}\n"
      "  - {name: box, shape: box, edges: [0.05, 0.05, 0.05], mass: 0.2, position: [-0.015, 0.05, 0.34]}\n"
      "ground: {}\n"
      "effects: [gravity, ground_contact, object_contact, friction, joint_stops, passive_tissue]\n"
      "duration: 1.5\nsolver: {cfm: 1e-7}\n" +
          rest,
      test::in_source("config/test.yaml")));
}

json entry_of(const json& list, const std::function<bool(const json&)>& wanted) {
  for (const json& entry : list)
    if (wanted(entry)) return entry;
  ADD_FAILURE() << "no such entry";
  return {};
}

// Oracle: statics; at rest the sums carry the weight to 0.1 %.
TEST(ContactOutput, SumsCarryTheWeightAtRest) {
  const test::TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  const RunResult result = run(still_life("record: {contacts: true}\n"), options);
  const json forces = json::parse(result.summary).at("contact_forces");
  const auto pair = [&](const char* a, const char* b) {
    return entry_of(forces.at("pairs"), [&](const json& e) { return e.at("a") == a && e.at("b") == b; });
  };
  const json mug = pair("block", "mug"), ground = pair("block", "ground"), palm = pair("right.palm", "box");
  EXPECT_NEAR(mug.at("force_at_end_N")[2].get<double>(), -0.118 * kGravity, 1e-3 * 0.118 * kGravity);
  EXPECT_NEAR(ground.at("force_at_end_N")[2].get<double>(), 0.418 * kGravity, 1e-3 * 0.418 * kGravity);
  EXPECT_NEAR(palm.at("force_at_end_N")[2].get<double>(), -0.2 * kGravity, 1e-3 * 0.2 * kGravity);
  const json finger =
      entry_of(forces.at("fingers"), [](const json& e) { return e.at("name") == "right.palm"; });
  EXPECT_NEAR(finger.at("normal_force_at_end_N").get<double>(), 0.2 * kGravity, 1e-3 * 0.2 * kGravity);
  // The box fell some millimetres first: the largest force is that of its landing, the mean its weight.
  EXPECT_GT(finger.at("largest_normal_force_N").get<double>(), 3 * 0.2 * kGravity);
  EXPECT_NEAR(finger.at("mean_normal_force_N").get<double>(), 0.2 * kGravity, 0.02 * 0.2 * kGravity);

  // The table has the same forces, point by point.
  std::istringstream lines(test::text_of(folder.path() / "contacts.csv"));
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  EXPECT_TRUE(line.starts_with("time[s],a,b,x[m]"));
  double on_ground = 0;
  int rows = 0;
  while (std::getline(lines, line)) {
    std::vector<std::string> cells(1);
    for (const char c : line) c == ',' ? cells.emplace_back() : cells.back() += c;
    ASSERT_EQ(cells.size(), 14U);
    if (std::stod(cells[0]) != 1.5 || cells[2] != "ground") continue;
    ++rows;
    on_ground += std::stod(cells[10]) * std::stod(cells[8]) + std::stod(cells[13]);
  }
  EXPECT_GE(rows, 4);
  EXPECT_NEAR(on_ground, 0.418 * kGravity, 1e-3 * 0.418 * kGravity);
}

TEST(ContactOutput, IsOffUnlessAskedFor) {
  const test::TemporaryFolder folder;
  RunOptions options;
  options.out = folder.path();
  const scene::Scene scene = still_life("");
  EXPECT_FALSE(scene.spec.solver.contact_forces);
  EXPECT_FALSE(json::parse(run(scene, options).summary).contains("contact_forces"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "contacts.csv"));
}

// Oracle: the definition; a round figure that gives the largest force 40 to 100 mm, and pixels of the arrows'
// own colour where there were none.
TEST(ContactForces, AreArrowsInThePicture) {
  const auto magenta = [](const output::Image& image) {
    long count = 0;
    for (std::size_t i = 0; i < image.rgb.size(); i += 3)
      count += image.rgb[i] > 110 && image.rgb[i + 1] < 60 && image.rgb[i + 2] > 60 ? 1 : 0;
    return count;
  };
  for (const bool shown : {true, false}) {
    const scene::Scene scene = still_life(shown ? "pictures: {contact_forces: true, size: [640, 480]}\n"
                                                : "pictures: {size: [640, 480]}\n");
    Simulation simulation(scene);
    for (int i = 0; i < 1000; ++i) simulation.step();
    const PictureState moment = picture_state(simulation.engine());
    const auto scale = force_scale(scene.spec.pictures, std::span(&moment, 1));
    ASSERT_EQ(scale.has_value(), shown);
    if (shown) {
      double largest = 0;
      for (const engine::Contact& contact : moment.contacts)
        largest = std::max(largest, contact.force.norm());
      EXPECT_GE(*scale * largest, 0.04);
      EXPECT_LE(*scale * largest, 0.1 + 1e-12);
    }
    const long pixels = magenta(draw({scene.model, scene.spec.pictures}, moment));
    if (shown)
      EXPECT_GT(pixels, 150);
    else
      EXPECT_EQ(pixels, 0);
  }
}

// An object that starts in a hand is refused unless that is allowed, or nothing lets the two touch.
TEST(ObjectInAHand, IsRefusedUnlessAllowedOrUntouchable) {
  const auto scene = [](const std::string& overlap, const std::string& effects) {
    return scene::compile_scene(parse_yaml(
        "hands: [{model: ../handmodels/anatomical.yaml, person: persons/median_man.yaml, side: right}]\n"
        "objects: [{name: ball, shape: sphere, radius: 0.02, mass: 0.1, position: [0, 0.05, 0.02]" +
            overlap + "}]\neffects: [" + effects + "]\nduration: 1\n",
        test::in_source("config/test.yaml")));
  };
  EXPECT_THROW(Simulation(scene("", "gravity, object_contact")), Error);
  EXPECT_NO_THROW(Simulation(scene(", overlap: allowed", "gravity, object_contact")));
  EXPECT_NO_THROW(Simulation(scene("", "gravity")));
}

}  // namespace
}  // namespace handsim::simulation
