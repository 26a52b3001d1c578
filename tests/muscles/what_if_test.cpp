// Hands with a nerve blocked, a tendon moved, a pulley torn, a joint fused.
#include "handsim/hand/what_if.h"

#include <cmath>

#include <gtest/gtest.h>

#include "handsim/engine/engine.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/simulation/simulation.h"
#include "scene_files.h"

namespace handsim::hand {
namespace {

HandSpec unchanged() {
  YamlNode root = load_yaml(test::source("handmodels/anatomical.yaml"));
  Diagnostics diagnostics;
  HandSpec spec = read_hand_spec(root, "", diagnostics);
  diagnostics.throw_if_any();
  return spec;
}

std::string hand_entry(const std::string& keys, const std::string& mount = "universal") {
  return "{model: " + test::source("handmodels/anatomical.yaml").string() +
         ", person: " + test::source("config/persons/median_man.yaml").string() +
         ", side: right, wrist: {mount: " + mount + "}, " + keys + "}";
}

scene::Scene scene_of(const std::string& keys, const std::string& mount = "universal",
                      const std::string& effects = "joint_stops, passive_tissue, muscles, tendon_coupling") {
  return scene::compile_scene(parse_yaml("title: t\nhands:\n  - " + hand_entry(keys, mount) + "\neffects: [" +
                                             effects + "]\nsolver: {engine: articulated}\nduration: 0.2\n",
                                         "scene.yaml"));
}

// Oracle: the keys by hand. All problems come at once, each with its place.
TEST(WhatIf, RefusesWhatAHandCannotHaveByName) {
  try {
    scene_of(
        "without: [ulnar_nerve_at_wirst, FDP2, FDP2],\n    transfers: [{from: FDP2, to: ECRB}, {from: ECU, "
        "to: ECRV}],\n    pulleys: {A7: none},\n    fused: {index_pip: 120 deg, elbow: 0},\n    "
        "range_limits: {index_dip.flexion: [10 deg, 95 deg]},\n    strength: -1");
    FAIL() << "accepted";
  } catch (const Error& error) {
    const std::string text = error.what();
    for (const char* part : {"scene.yaml:3:", "got ulnar_nerve_at_wirst, need a nerve at a level",
                             "nearest: ulnar_nerve_at_wrist", "without: got FDP2 a second time",
                             "scene.yaml:4:", "transfers.0.from: got FDP2, which is lost or moved",
                             "transfers.1.to: got ECRV", "pulleys.A7: got A7", "scene.yaml:6:",
                             "fused.index_pip: got flexion at 120 deg, need within its range, 0 to 100",
                             "fused.elbow: got elbow",
                             "range_limits.index_dip.flexion: got flexion at 95 deg", "strength: got -1"})
      EXPECT_NE(text.find(part), std::string::npos) << part << "\nin\n" << text;
  }
  try {
    scene_of("without: [FDP2], fused: {index_pip: 20 deg}", "universal", "joint_stops");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("hands.0.without: got a hand without muscles"),
              std::string::npos)
        << error.what();
  }
}

// Oracle: a map without the keys changes nothing; the resolved scene has the same muscles to the bit.
TEST(WhatIf, IsRepeatedByTheResolvedScene) {
  YamlNode none = parse_yaml("{other: 1}", "keys.yaml");
  Diagnostics diagnostics;
  MapReader reader(none, "", diagnostics);
  EXPECT_FALSE(read_what_if(reader, unchanged()));
  const scene::Scene first = scene_of(
      "without: {median_nerve_at_wrist: 0.5, FCR: 1}, transfers: [{from: FDS4, to: APB, rest: 1.1}], "
      "pulleys: {middle_A4: none}, strength: 0.7, fused: {wrist: 20 deg}, range_limits: "
      "{ring_pip.flexion: [20 deg, 60 deg]}");
  const scene::Scene again = scene::compile_scene(YamlNode(first.resolved));
  ASSERT_EQ(first.model.muscles.size(), again.model.muscles.size());
  const model::State a = model::initial_state(first.model), b = model::initial_state(again.model);
  EXPECT_EQ(a.q, b.q);
  for (std::size_t i = 0; i < first.model.muscles.size(); ++i) {
    const model::Muscle &one = first.model.muscles[i], &other = again.model.muscles[i];
    EXPECT_EQ(one.length, other.length) << one.name;
    EXPECT_EQ(one.force, other.force) << one.name;
    EXPECT_EQ(one.excitable, other.excitable) << one.name;
    EXPECT_EQ(one.effort, other.effort) << one.name;
    EXPECT_EQ(model::path_state(one.path, a.q).excursion, model::path_state(other.path, b.q).excursion)
        << one.name;
  }
}

// Oracle: the same hand with a wrist that is held at this angle. A palm that does not move has no wrist; its
// muscles are as long as with the wrist at the angle at which it is fused.
TEST(WhatIf, MusclesOfAFusedWristAreThoseOfItsAngle) {
  const scene::Scene fused = scene_of("fused: {wrist.flexion: -25 deg, wrist.deviation: 5 deg}", "fixed");
  const scene::Scene free = scene_of("pose: {wrist: [-25 deg, 5 deg]}");
  const model::State of_fused = model::initial_state(fused.model), of_free = model::initial_state(free.model);
  for (std::size_t i = 0; i < free.model.muscles.size(); ++i) {
    const model::Muscle &a = fused.model.muscles[i], &b = free.model.muscles[i];
    EXPECT_NEAR(a.length - model::path_state(a.path, of_fused.q).excursion,
                b.length - model::path_state(b.path, of_free.q).excursion, 1e-15)
        << a.name;
  }
}

// Oracle: the angle: a joint that is fused stays there within the range that holds it, in both engines that
// have stops, under the flexor at full force; static optimisation asks no muscle for its moment.
TEST(WhatIf, AFusedJointStays) {
  for (const char* engine : {"articulated", "ode"}) {
    YamlNode node =
        parse_yaml("title: t\nhands:\n  - " + hand_entry("fused: {index_pip: 30 deg}", "fixed") +
                       "\neffects: [joint_stops, passive_tissue, muscles]\nexcitations: {times: [0], "
                       "FDP2: [1]}\nduration: 0.1\nsolver: {engine: " +
                       engine + ", step: 0.5 ms}\n",
                   "scene.yaml");
    const scene::Scene scene = scene::compile_scene(std::move(node));
    simulation::Simulation run(scene);
    while (run.state().time < 0.1 - 1e-9) run.step();
    for (const model::Joint& joint : scene.model.joints) {
      if (joint.name != "right.index_pip") continue;
      EXPECT_NEAR(run.state().q[static_cast<std::size_t>(joint.first_dof)] * 180 / M_PI, 30, 1) << engine;
    }
  }
}

}  // namespace
}  // namespace handsim::hand
