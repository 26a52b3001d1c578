#include "handsim/output/render/skin.h"

#include <gtest/gtest.h>

#include "handsim/output/render/mesh.h"
#include "output/render/scenes.h"
#include "output/render/skin_measures.h"
#include "support/sanitized.h"

namespace handsim::output {
namespace {

/// The hands of every_pose.yaml for a person.
scene::Scene hands_of(const std::string& person, const std::string& model = "anatomical") {
  std::vector<std::string> overrides;
  for (const char* hand : {"hands.0.", "hands.1."}) {
    overrides.push_back(std::string(hand) +
                        "person=" + test::source("config/persons/" + person + ".yaml").string());
    overrides.push_back(std::string(hand) +
                        "model=" + test::source("handmodels/" + model + ".yaml").string());
  }
  return test::shipped_scene("every_pose", overrides);
}

/// One right hand of a person of this stature and mass.
model::Model drawn_hand(double stature, double mass, hand::Sex sex) {
  hand::Person person;
  person.stature = stature;
  person.mass = mass;
  person.sex = sex;
  static const auto spec = hands_of("median_man").spec.hands.front().model;
  model::Model model = model::make_model();
  hand::add_hand(model, hand::build_hand(*spec, person), {});
  return model;
}

const std::vector<std::string> kPersons =
    test::kSanitized
        ? std::vector<std::string>{"child", "giant"}
        : std::vector<std::string>{"child",       "giant",        "large_man",    "large_woman",
                                   "median_man",  "median_woman", "small_man",    "small_woman",
                                   "elder_woman", "boy_7_years",  "girl_4_years", "girl_10_years"};

void expect_closed(const Skin& skin, const std::string& whose) {
  const std::map<Edge, int> edges = directed_edges(skin);
  for (const auto& [edge, count] : edges)
    ASSERT_TRUE(count == 1 && edges.contains({edge.second, edge.first})) << whose;
  EXPECT_EQ(euler_characteristic(skin), 2) << whose;
  EXPECT_GT(volume_beyond(skin, skin.points, -1), 0) << whose;
  EXPECT_GT(skin.faces.size(), 8000U) << whose;
  EXPECT_LT(skin.faces.size(), 15000U) << whose;
}

// Oracle: topology. Each edge has a triangle on either side, in opposite directions; V - E + F = 2.
TEST(Skin, OfEveryPersonIsOneClosedSurface) {
  for (const std::string& name : kPersons) {
    const scene::Scene scene = hands_of(name);
    for (const model::HandIndex& hand : scene.model.hands) expect_closed(make_skin(scene.model, hand), name);
  }
  for (int i = 0; i < 12; i += test::kSanitized ? 6 : 1) {
    const double stature = 1.45 + 0.05 * i, mass = 22 * stature * stature * (0.8 + 0.1 * (i % 7));
    const model::Model model = drawn_hand(stature, mass, i % 2 == 0 ? hand::Sex::male : hand::Sex::female);
    expect_closed(make_skin(model, model.hands.front()), std::to_string(stature));
  }
}

TEST(Skin, OfOtherHandModelsIsOneClosedSurface) {
  for (const char* name : {"prototype_poses", "resting_hand"}) {
    const scene::Scene scene = test::shipped_scene(name);
    expect_closed(make_skin(scene.model, scene.model.hands.front()), name);
  }
  const scene::Scene forearm = test::shipped_scene(
      "every_pose",
      {"hands.0.model=" + test::source("handmodels/forearm.yaml").string(), "hands.0.wrist.mount=universal"});
  ASSERT_TRUE(forearm.model.hands.front().forearm);
  expect_closed(make_skin(forearm.model, forearm.model.hands.front()), "forearm");
}

/// Largest n . x over the part of shapes in the plane of this y, by the circles about their axes.
double section_support(const std::vector<Solid>& shapes, double y, double cosine, double sine) {
  double most = -1;
  for (const Solid& shape : shapes)
    for (int i = 0; i <= 100; ++i) {
      const Vec3 p = shape.pose * Vec3(0, 0, shape.half.z() * (i / 50.0 - 1));
      const double room = shape.round * shape.round - (y - p.y()) * (y - p.y());
      if (room > 0) most = std::max(most, p.x() * cosine + p.z() * sine + std::sqrt(room));
    }
  return most;
}

/// Turns the line from the index's to the little finger's knuckle along x; the y of that line.
std::pair<Quat, double> along_knuckles(const scene::Scene& scene) {
  const model::HandIndex& hand = scene.model.hands.front();
  const auto knuckle = [&](const std::string& name) {
    const auto joint = std::ranges::find(scene.model.joints, hand.name + name, &model::Joint::name);
    return hand.wrist_frame.inverse() * joint->parent_frame.p;
  };
  const Vec3 index = knuckle(".index_mcp"), line = knuckle(".little_mcp") - index;
  const Quat turn(Eigen::AngleAxisd(-std::atan2(line.y(), line.x()), Vec3::UnitZ()));
  return {turn, (turn * index).y()};
}

// Oracle: the shapes, which have the person's dimensions (the fingers end 1 % short of the hand's length). Of
// the skin without thumb, a tape over the knuckles, the breadth there and the length differ by under 1 mm;
// nearer to the wrist the webs add to them.
TEST(Skin, HasTheDimensionsOfTheShapes) {
  for (const std::string& name : kPersons) {
    const scene::Scene scene = hands_of(name);
    const model::Model& model = scene.model;
    const Skin skin = make_skin(model, model.hands.front());
    const model::State zero =
        model::state_at(model, std::vector<double>(static_cast<std::size_t>(model.dof_count())));
    const std::vector<Pose> bodies = in_hand(scene, skin, zero);
    std::vector<Vec3> points = posed(skin, bodies);
    const auto [turn, knuckles] = along_knuckles(scene);
    Skin without_thumb = skin;
    std::erase_if(without_thumb.faces, [&, i = 0UL](const auto&) mutable {
      return model.shapes[static_cast<std::size_t>(skin.shapes[i++])].part == model::Part::thumb;
    });
    std::vector<Solid> shapes;
    double length = 0;
    for (const model::Shape& shape : model.shapes) {
      const auto found = std::ranges::find(skin.bodies, shape.body);
      if (found == skin.bodies.end()) continue;
      const Solid exact =
          solid(shape, bodies[static_cast<std::size_t>(found - skin.bodies.begin())] * shape.pose);
      length = std::max(length, support(exact, Vec3::UnitY()));
      if (shape.part == model::Part::thumb) continue;
      shapes.push_back(exact);
      shapes.back().pose = Pose{Vec3::Zero(), turn} * exact.pose;
    }
    double tip = 0;
    for (const Vec3& p : points) tip = std::max(tip, p.y());
    EXPECT_NEAR(tip, length, 1e-3) << name;
    for (Vec3& p : points) p = turn * p;
    double girth = 0;
    for (int k = 0; k < 90; ++k)
      girth +=
          section_support(shapes, knuckles, std::cos(k * M_PI / 45), std::sin(k * M_PI / 45)) * M_PI / 45;
    EXPECT_NEAR(tape(without_thumb, points, knuckles), girth, 1e-3) << name;
    const double breadth = section_support(shapes, knuckles, 1, 0) + section_support(shapes, knuckles, -1, 0);
    EXPECT_NEAR(extent_at(without_thumb, points, knuckles), breadth, 1e-3) << name;
  }
}

// Oracle: the mass of a hand whose palm has no matter of its own: density times the volume of the union of
// the shapes, round which skin is drawn; webs add to it. Beyond the wrist's joint centre, where the hand
// begins.
TEST(Skin, HasTheVolumeOfTheHand) {
  for (const std::string& name : kPersons) {
    const scene::Scene scene = hands_of(name);
    const Skin skin = make_skin(scene.model, scene.model.hands.front());
    const model::State zero =
        model::state_at(scene.model, std::vector<double>(static_cast<std::size_t>(scene.model.dof_count())));
    const scene::HandEntry& entry = scene.spec.hands.front();
    const double volume = volume_beyond(skin, posed(skin, in_hand(scene, skin, zero)), 0);
    hand::HandSpec of_shapes = *entry.model;
    of_shapes.palm.matter.clear();
    EXPECT_NEAR(1148 * volume / hand::build_hand(of_shapes, entry.person).mass, 1, 0.03) << name;
  }
}

// Oracle: a triangle must face as its bodies have turned it. All poses of the file, both sides.
TEST(Skin, HasNoInvertedTriangleInAnyPose) {
  for (const auto& [side, other] :
       {std::pair("right", "hands.1.side=left"), {"left", "hands.1.side=right"}}) {
    const scene::Scene scene =
        test::shipped_scene("every_pose", {std::string("hands.0.side=") + side, other});
    const Skin skin = make_skin(scene.model, scene.model.hands.front());
    ASSERT_EQ(scene.spec.control->poses->poses.size(), 15U);
    int count = 0;
    for (const auto& [name, pose] : scene.spec.control->poses->poses) {
      // The left hand is the right one's mirror: a third of its poses shows that its skin is, too.
      if ((scene.model.hands.front().side == model::Side::left || test::kSanitized) && count++ % 3 != 0)
        continue;
      const std::vector<Pose> bodies = in_hand(scene, skin, in_pose(scene, name));
      EXPECT_EQ(inverted(skin, bodies, posed(skin, bodies)), 0) << side << " " << name;
    }
  }
}

// Oracle: the skin of the hand with the pad on its palm, at zero angles, where both hands have the same
// shapes. 0.2 mm: a smooth union depends a little on its order.
TEST(Skin, OfAThumbThatCarriesItsPadHasTheFormOfTheRigidPalm) {
  HANDSIM_SKIP_WITH_SANITIZER("two skins; other tests make skins");
  const test::TemporaryFolder folder;
  const std::filesystem::path rigid = test::source("handmodels/anatomical.yaml"),
                              carried = folder.path() / "hand.yaml";
  std::ofstream(carried) << "title: a thumb that carries its thenar pad\nbased_on: " << rigid.string()
                         << "\nsegments:\n  - {name: thumb_metacarpal, of_palm: [thenar]}\n";
  std::vector<Skin> skins;
  for (const std::filesystem::path& model : {rigid, carried}) {
    const scene::Scene scene = test::shipped_scene("every_pose", {"hands.0.model=" + model.string()});
    skins.push_back(make_skin(scene.model, scene.model.hands.front()));
    expect_closed(skins.back(), model.string());
  }
  const double volume = volume_beyond(skins[0], skins[0].points, 0);
  EXPECT_NEAR(volume_beyond(skins[1], skins[1].points, 0) / volume, 1, 1e-3);
  double farthest = 0;
  const std::vector<Vec3> normals = normals_of(skins[0], skins[0].points);
  for (const Vec3& point : skins[1].points) {
    std::size_t near = 0;
    for (std::size_t i = 1; i < skins[0].points.size(); ++i)
      if ((skins[0].points[i] - point).squaredNorm() < (skins[0].points[near] - point).squaredNorm())
        near = i;
    farthest = std::max(farthest, std::abs(normals[near].dot(point - skins[0].points[near])));
  }
  EXPECT_LT(farthest, 2e-4);
}

// Oracle: a rigid motion of all bodies moves the skin rigidly; weights sum to 1.
TEST(Skin, MovesRigidlyWithTheWholeHand) {
  const scene::Scene scene = hands_of("median_man");
  const Skin skin = make_skin(scene.model, scene.model.hands.front());
  EXPECT_NEAR((skin.weights.rowwise().sum().array() - 1).abs().maxCoeff(), 0, 1e-5);
  EXPECT_GE(skin.weights.minCoeff(), 0);
  const Pose motion = {{0.3, -1, 2}, Quat(Eigen::AngleAxisd(2, Vec3(1, 2, 3).normalized()))};
  std::vector<Pose> bodies;
  for (const Pose& rest : skin.rest) bodies.push_back(motion * rest);
  const std::vector<Vec3> points = posed(skin, bodies);
  // Weights are single precision, at 2 m from the origin.
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_LT((points[i] - motion * skin.points[i]).norm(), 1e-6);
}

// Oracle: the left hand's own skin, made from its shapes on a grid of its own.
TEST(Skin, OfALeftHandIsTheMirrorImageOfTheRight) {
  const scene::Scene scene = hands_of("median_man");
  const model::HandIndex& left = scene.model.hands[1];
  ASSERT_EQ(left.side, model::Side::left);
  const Skin mirrored = *skins_of(scene.model)[1], own = make_skin(scene.model, left);
  expect_closed(mirrored, "left");
  EXPECT_EQ(mirrored.bodies, own.bodies);
  for (const int shape : mirrored.shapes)
    EXPECT_NE(std::ranges::find(left.bodies, scene.model.shapes[static_cast<std::size_t>(shape)].body),
              left.bodies.end());
  for (std::size_t b = 0; b < own.rest.size(); ++b) {
    EXPECT_LT((mirrored.rest[b].p - own.rest[b].p).norm(), 1e-9);
    EXPECT_LT(mirrored.rest[b].q.angularDistance(own.rest[b].q), 1e-7);
  }
  // 3 mm is the grid's cell: as far the nearest of two corners may be.
  for (std::size_t i = 0; i < mirrored.points.size(); i += 17) {
    double nearest = 1;
    for (const Vec3& other : own.points) nearest = std::min(nearest, (mirrored.points[i] - other).norm());
    ASSERT_LT(nearest, 3e-3);
  }
  EXPECT_NEAR(volume_beyond(mirrored, mirrored.points, 0) / volume_beyond(own, own.points, 0), 1, 1e-3);
}

// Oracle: in a draw list, pieces of skin are all of its triangles, with outward normals, and the stump is
// gone.
TEST(Skin, PiecesInADrawListAreTheWholeSkin) {
  const scene::Scene scene = hands_of("median_man");
  const model::State state = model::initial_state(scene.model);
  DrawList list = draw_list(scene.model, state, {});
  std::size_t faces = 0, drawn = 0;
  for (const auto& skin : skins_of(scene.model)) {
    faces += skin->faces.size();
    put_on(*skin, scene.model, state, {1, 0, 0}, false, list);
  }
  for (const DrawShape& shape : list.shapes) {
    if (shape.skin) {
      drawn += shape.skin->indices.size() / 3;
    } else {
      EXPECT_TRUE(shape.mark && !shape.shades);
    }
  }
  EXPECT_EQ(drawn, faces);
  EXPECT_EQ(skins_of(scene.model)[0], skins_of(scene.model)[0]);
}

}  // namespace
}  // namespace handsim::output
