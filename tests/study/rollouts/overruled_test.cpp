// Overrides that act on nothing, because another key wins.
#include "handsim/scene/compile/overruled.h"

#include <gtest/gtest.h>

#include "handsim/environment/environment.h"
#include "scene_files.h"

namespace handsim::scene {
namespace {

using test::source;

struct Set {
  const char* name;
  const char* scene;
  std::vector<std::string> overrides;
  const char* by;  ///< of the last one: part of its reason; empty: it acts
};

void PrintTo(const Set& set, std::ostream* out) { *out << set.name; }

const char* const kBalls = R"(
objects:
  - {name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0.2]}
  - {name: other, shape: sphere, radius: 0.1, mass: 1, position: [0, 1, 0.2]}
ground: {}
effects: [gravity, ground_contact, friction]
contacts:
  materials: [{name: ice, friction: 0.01}, {name: spare}]
  rules: [{between: [objects, ground], material: ice}]
duration: 0.02
)";
const char* const kBall = R"(
objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0.2]}]
ground: {}
duration: 0.02
)";

class Overrides : public testing::TestWithParam<Set> {};

// Oracle: what each key is documented to act on.
TEST_P(Overrides, AreToldWhereTheyActOnNothing) {
  const Set& set = GetParam();
  const std::string name = set.scene;
  const Scene scene = name.ends_with(".yaml") ? load_scene(source("config/" + name), set.overrides)
                                              : load_scene(parse_yaml(name, "balls"), set.overrides);
  const std::string& last = set.overrides.back();
  const std::string path = last.substr(0, last.find('='));
  std::string found;
  for (const Overruled& each : overruled(scene))
    if (each.path == path) found = each.text();
  if (*set.by == 0)
    EXPECT_EQ(found, "");
  else
    EXPECT_NE(found.find(set.by), std::string::npos) << found;
  bool warned = false;
  for (const std::string& warning : scene.warnings)
    warned = warned || (!found.empty() && warning == "--set " + path + ": " + found);
  EXPECT_EQ(warned, *set.by != 0);
}

const std::string kNoContact = "effects=[gravity]";

INSTANTIATE_TEST_SUITE_P(
    , Overrides,
    testing::Values(
        Set{"FrictionActs", kBall, {"objects.0.friction=0.1"}, ""},
        Set{"FrictionOfBothActs", kBall, {"ground.friction=0.1"}, ""},
        Set{"FrictionUnderARule",
            "grasp_power_can.yaml",
            {"objects.0.friction=0.02"},
            "has no effect: contacts.rules.0 gives hands and objects the material pad"},
        Set{"RestitutionUnderARule",
            kBalls,
            {"objects.0.restitution=0.5"},
            "contacts.rules.0 gives objects and ground"},
        Set{"GroundUnderARule", kBalls, {"ground.friction=0.5"}, "contacts.rules.0"},
        Set{"OnOtherContacts",
            kBalls,
            {"effects=[gravity, object_contact, ground_contact, friction]",
             "contacts.rules=[{between: [objects, ground], material: ice}, {between: [objects, objects]}]",
             "objects.0.friction=0.5"},
            "acts on other contacts only: contacts.rules.0"},
        Set{"MaterialOfARule", kBalls, {"contacts.materials.0.friction=0.5"}, ""},
        Set{"MaterialOfNoContact",
            kBalls,
            {"contacts.materials.1.friction=0.5"},
            "no contact has the material spare"},
        Set{"MassActs", kBalls, {"objects.0.mass=2"}, ""},
        Set{"FrictionWithoutItsEffect",
            kBall,
            {"effects=[gravity, ground_contact]", "objects.0.friction=0.1"},
            "the effect friction is not among effects"},
        Set{"RestitutionWithoutContact",
            kBall,
            {kNoContact, "objects.0.restitution=0.1"},
            "no effect of contact"},
        Set{"GroundWithoutItsEffect", kBall, {kNoContact, "ground.height=-1"}, "the effect ground_contact"},
        Set{"GravityWithoutItsEffect",
            kBall,
            {"effects=[ground_contact]", "gravity=[0, 0, -1]"},
            "the effect gravity"},
        Set{"AComponentOfIt",
            kBall,
            {"effects=[ground_contact]", "gravity=[0, 0, -2]", "gravity.2=-1"},
            "the effect gravity"},
        Set{"SeedOfWorldStep", kBall, {"solver.seed=2"}, "method world_step does not use it"},
        Set{"SeedOfQuickStep", kBall, {"solver.method=quick_step", "solver.seed=2"}, ""},
        Set{"Tolerance",
            kBall,
            {"solver.engine=articulated", "solver.tolerance=1e-6"},
            "method semi_implicit_euler"},
        Set{"TissueWithoutItsEffect",
            "two_hands.yaml",
            {"effects=[gravity, joint_stops]", "hands.0.tissue.damping=2"},
            "the effect passive_tissue"},
        Set{"StrengthOfNoTask", "two_hands.yaml", {"hands.0.person.age=30"}, "no grip and no climb"},
        Set{"SkinUnderARule",
            "grasp_power_can.yaml",
            {"hands.0.model.skin.friction=0.3"},
            "contacts.rules.0"}),
    [](const auto& set) { return set.param.name; });

// Oracle: the same reason as of --set.
TEST(Environment, RefusesNumbersThatActOnNothing) {
  const Scene scene = load_scene(source("config/grasp_power_can.yaml"));
  environment::Setup setup;
  setup.randomise = {{"objects.0.friction", environment::Distribution::uniform, 0.1, 1}};
  try {
    const environment::Environment environment(scene, setup);
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_STREQ(
        error.what(),
        "objects.0.friction: got a number without effect (contacts.rules.0 gives hands and objects the "
        "material pad), need one that acts in this scene");
  }
  environment::Environment environment(scene);
  EXPECT_THROW(environment.set("objects.0.friction", std::vector<double>{0.5}), Error);
  environment.set("objects.0.mass", std::vector<double>{0.5});
}

}  // namespace
}  // namespace handsim::scene
