// Hands with a nerve blocked, a tendon moved, a pulley torn, a joint fused.
#include "handsim/hand/what_if.h"

#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "handsim/engine/engine.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/simulation/simulation.h"
#include "handsim/study/validate/subject.h"
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

HandSpec changed(const std::string& keys) {
  YamlNode node = parse_yaml("{" + keys + "}", "keys.yaml");
  Diagnostics diagnostics;
  MapReader reader(node, "", diagnostics);
  const std::optional<HandSpec> out = read_what_if(reader, unchanged());
  reader.finish();
  diagnostics.throw_if_any();
  return out.value();
}

/// Of a hand of the size that the file's arms are of.
study::Subject subject(const HandSpec& spec) {
  Person man;
  man.sex = Sex::male;
  man.age = 30;
  man.hand_length = spec.muscles->hand_length;
  return {spec, man};
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

// Oracle: what hand surgery calls an ulnar claw: the same pull of extensor and flexors, with the interossei
// and the lumbrical of the ring finger paralysed, extends its MCP and flexes its PIP.
TEST(WhatIf, UlnarBlockClawsTheRingFinger) {
  std::map<std::string, double> angle[2];
  for (const bool blocked : {false, true}) {
    const study::Subject hand =
        subject(blocked ? changed("without: [ulnar_nerve_at_wrist]") : changed("strength: 1"));
    std::map<const model::Muscle*, double> pull;
    for (const auto& [name, share] : std::map<std::string, double>{
             {"EDC4", 0.05}, {"FDP4", 0.02}, {"FDS4", 0.02}, {"LU4", 0.1}, {"DI4", 0.1}, {"PI2", 0.1}}) {
      const model::Muscle& muscle = *hand.muscle(name);
      // A muscle whose nerve is blocked still pulls at rest.
      const bool rests = muscle.excitable == 0;
      if (!rests) pull[&muscle] = share * muscle.force;
      EXPECT_EQ(rests, blocked && (name[0] == 'L' || name[1] == 'I')) << name;
    }
    std::vector<double> q = hand.coordinates({{"ring_mcp.flexion", 0.5}, {"ring_pip.flexion", 0.5}});
    q = hand.balance(q, hand.finger_dofs("ring"), pull);
    for (const char* axis : {"ring_mcp.flexion", "ring_pip.flexion"})
      angle[blocked][axis] = q[static_cast<std::size_t>(*hand.dof(axis))] * 180 / M_PI;
  }
  EXPECT_LT(angle[1]["ring_mcp.flexion"], angle[0]["ring_mcp.flexion"] - 10);
  EXPECT_GT(angle[1]["ring_pip.flexion"], angle[0]["ring_pip.flexion"] + 10);
}

/// Point of a straight finger in the plane of flexion that the PIP turns, from the joint's centre.
Eigen::Vector2d beyond(double along, double height, double pip) {
  return Eigen::Rotation2Dd(-pip) * Eigen::Vector2d(along, -height);
}

// Oracle: the lengths of straight lines between the pulleys (Pythagoras). Without A4 the deep flexor of the
// middle finger runs from A2 to its end on the distal phalanx: it gains an arm about the PIP and needs more
// excursion. The polynomials have them within 0.25 mm.
TEST(WhatIf, ATornPulleyBowstringsAsStraightLinesDo) {
  const study::Subject whole = subject(changed("strength: 1")),
                       torn = subject(changed("pulleys: {A4: none}"));
  const double hand = 0.178, proximal = 0.266 * hand, middle = 0.170 * hand;
  const double mcp = 0.01064, at_pip = 0.00804, at_dip = 0.00418;
  const auto height = [&](double share) { return at_pip + share * (at_dip - at_pip); };
  const Eigen::Vector2d a2(-0.48 * proximal, -(mcp + 0.52 * (at_pip - mcp)));
  const auto length = [&](double pip, bool is_torn) {
    const Eigen::Vector2d end = beyond(1.1 * middle, at_dip, pip);
    if (is_torn) return (end - a2).norm();
    const Eigen::Vector2d from = beyond(0.35 * middle, height(0.35), pip);
    return (from - a2).norm();  // beyond A4 nothing changes with the PIP
  };
  double before = 0;
  for (const double pip : {0.0, 0.4, 0.8, 1.2, 1.6}) {
    const auto excursion = [&](const study::Subject& of) {
      const auto q = of.coordinates({{"middle_pip.flexion", pip}});
      return model::path_state(of.muscle("FDP3")->path, q).excursion;
    };
    const double gained = excursion(torn) - excursion(whole);
    const double wanted = length(pip, false) - length(0, false) - length(pip, true) + length(0, true);
    EXPECT_NEAR(gained, wanted, 0.25e-3) << pip;
    EXPECT_GE(gained, before - 1e-6);
    before = gained;
  }
  EXPECT_GT(before, 2e-3);
}

// Oracle: the receiver's arms and the donor's force: an extensor of the wrist that a flexor becomes. And it
// restores: without the radial nerve nothing extends the wrist.
TEST(WhatIf, ATransferRestoresTheWristsExtension) {
  const study::Subject whole = subject(changed("strength: 1")),
                       blocked = subject(changed("without: [radial_nerve_at_arm]")),
                       moved = subject(
                           changed("without: [radial_nerve_at_arm], transfers: [{from: FCR, to: ECRB}]"));
  const std::vector<double> q = whole.coordinates({});
  const int wrist = *whole.dof("wrist.flexion");
  const auto moment = [&](const study::Subject& of, const std::string& name) {
    const model::Muscle& muscle = *of.muscle(name);
    return -of.arm(muscle, wrist, q) *
           model::isometric_force(muscle, model::path_state(muscle.path, q).excursion);
  };
  EXPECT_GT(moment(whole, "ECRB"), 1);
  EXPECT_EQ(moment(blocked, "ECRB"), 0);
  const double arm = -whole.arm(*whole.muscle("ECRB"), wrist, q);
  EXPECT_NEAR(-moved.arm(*moved.muscle("FCR"), wrist, q), arm, 1e-15);
  // At its fibres' optimal length at the rest angles, which the wrist's 0 deg is.
  EXPECT_NEAR(moment(moved, "FCR"), arm * whole.muscle("FCR")->force,
              0.01 * arm * whole.muscle("FCR")->force);
}

// Oracle: a ratio of two rows of the same file, one of them of a changed hand; the adductor is the ulnar
// nerve's.
TEST(WhatIf, UlnarBlockWeakensTheKeyPinch) {
  const test::TemporaryFolder folder;
  const auto file = folder.path() / "own.yaml";
  const std::string row =
      "kind: tip_force, person: man, finger: thumb, segment: thumb_distal, direction: palmar, "
      "friction: 0.8, pose: {thumb_mcp.flexion: 20 deg, thumb_ip.flexion: 20 deg}, measured: 1, "
      "spread: 1, source: s, of: people, spread_is: source, value_is: fitted";
  std::ofstream(file)
      << "title: t\nhand: " << test::source("handmodels/anatomical.yaml").string()
      << "\nvariants:\n  block: {without: [ulnar_nerve_at_wrist]}\n  weak: {strength: 0.5}\npeople: {man: "
      << test::source("config/persons/median_man.yaml").string() << "}\nmeasurements:\n  - {name: whole, "
      << row << "}\n  - {name: blocked, hand: block, " << row
      << "}\n  - {name: share, hand: block, relative_to: whole, " << row
      << "}\n  - {name: half, hand: weak, relative_to: whole, " << row << "}\n";
  const study::ValidateResult result = study::run_validate(study::load_validate(file));
  EXPECT_NEAR(result.rows[2].ours, result.rows[1].ours / result.rows[0].ours, 1e-12);
  EXPECT_LT(result.rows[2].ours, 0.9);
  EXPECT_NEAR(result.rows[3].ours, 0.5, 0.01);  // The search lets 1 % of a torque be missing.
}

}  // namespace
}  // namespace handsim::hand
