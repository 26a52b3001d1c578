// What pictures of a run show: the camera that follows the hand, lost objects, the extremes of a shake, and
// the frames of a video.
#include "handsim/simulation/run/pictures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "handsim/model/kinematics.h"
#include "handsim/simulation/run/film.h"
#include "handsim/simulation/run/recorder.h"
#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::simulation {
namespace {

/// Projects the box of a list: its share of the picture's area, and whether all of it is in the picture.
struct Fill {
  double share = 0;
  bool whole = true;
};

/// Oracle: a pinhole camera, applied to points on the surfaces in 400 directions.
Fill fill_of(const output::DrawList& list, const output::Camera& camera, double aspect) {
  const Vec3 z = (camera.position - camera.target).normalized();
  const Vec3 x = camera.up.cross(z).normalized(), y = z.cross(x);
  const double slope = std::tan(camera.field_of_view / 2);
  Eigen::Array2d low = Eigen::Array2d::Constant(1e9), high = -low;
  for (const output::DrawShape& drawn : list.shapes) {
    const output::Solid& solid = drawn.solid;
    for (int i = 0; i < 400; ++i) {
      const double h = 1 - (2 * i + 1) / 400.0, a = i * 2.399963;
      const Vec3 n(std::sqrt(1 - h * h) * std::cos(a), std::sqrt(1 - h * h) * std::sin(a), h);
      // The farthest point of the core in this direction, and the rounding.
      Vec3 core = solid.half.array() * n.array().sign();
      if (solid.core == output::Core::cylinder && n.head<2>().norm() > 0)
        core.head<2>() = solid.half.x() * n.head<2>().normalized();
      if (solid.core == output::Core::hull) core = Vec3::Zero();
      const Vec3 p = solid.pose * (core + solid.round * n) - camera.position;
      const double depth = -p.dot(z);
      const Eigen::Array2d at(p.dot(x) / depth / slope / aspect, p.dot(y) / depth / slope);
      low = low.min(at);
      high = high.max(at);
    }
  }
  const Eigen::Array2d size = high - low;
  return {size.prod() / 4, low.minCoeff() > -1 && high.maxCoeff() < 1};
}

class ShippedGrasp : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(, ShippedGrasp,
                         ::testing::Values("cracker_box", "cup", "cylinder_100mm", "cylinder_50mm",
                                           "hook_bar", "pinch", "power_can", "sphere_35mm", "sphere_70mm",
                                           "tripod"));

// The start, and the end of the closing: the hand and what it touches fill half of the picture, and no part
// is cut.
TEST_P(ShippedGrasp, FillsHalfOfThePicture) {
  if (GetParam() != std::string("tripod")) {
    HANDSIM_SKIP_WITH_SANITIZER("another grasp is drawn");
  }
  const scene::Scene scene = test::shipped_scene(std::string("grasp_") + GetParam());
  Simulation simulation(scene);
  std::vector<PictureState> moments = {picture_state(simulation.engine())};
  const scene::TaskPhase* close = scene.plans.grasps.front().phase("close");
  while (simulation.state().time < close->end) simulation.step();
  moments.push_back(picture_state(simulation.engine()));
  const auto [width, height] = scene.spec.pictures.size;
  const Pictured of{scene.model, scene.spec.pictures};
  const std::vector<output::Camera> from = cameras(of, moments);
  for (std::size_t i = 0; i < moments.size(); ++i) {
    const output::DrawList list = followed(of, moments[i], shown(of, moments[i], {}));
    const Fill fill = fill_of(list, from[i], static_cast<double>(width) / height);
    EXPECT_GE(fill.share, 0.5) << GetParam() << " " << i;
    EXPECT_TRUE(fill.whole) << GetParam() << " " << i;
  }
}

/// A grasp at its start, whose object may have been lost.
PictureState with_object_at(const scene::Scene& scene, double z) {
  PictureState moment{model::initial_state(scene.model), {}};
  for (std::size_t i = 0; i < scene.model.bodies.size(); ++i)
    if (scene.model.bodies[i].name == scene.plans.grasps.front().object) moment.state.bodies[i].p.z() = z;
  return moment;
}

// Oracle: the pictures of the same hand without the object. An object 1,820 m below changes nothing.
TEST(LostObject, IsNotShownAndMovesNoCamera) {
  for (const char* follow : {"true", "false"}) {
    const scene::Scene scene =
        test::shipped_scene("grasp_power_can", {std::string("pictures.follow=") + follow});
    const std::vector<PictureState> lost = {with_object_at(scene, -1820)},
                                    near = {with_object_at(scene, 0.4)};
    const Pictured of{scene.model, scene.spec.pictures};
    const output::DrawList list = shown(of, lost.front(), {});
    EXPECT_EQ(list.shapes.size() + 1, shown(of, near.front(), {}).shapes.size());
    EXPECT_GT(output::bounds(list).low.z(), -1);
    const output::Camera camera = cameras(of, lost).front();
    EXPECT_LT((camera.position - model::initial_state(scene.model).bodies[1].p).norm(), 2) << follow;
  }
}

RunOptions with_phases(const std::filesystem::path& out) {
  RunOptions options;
  options.out = out;
  options.pose_pictures = true;
  return options;
}

// Oracle: the shake's own displacement of the wrist, from its amplitude; the pose at rest is that of the
// hold.
TEST(Phases, OfAShakeShowItsExtremes) {
  const test::TemporaryFolder folder;
  const scene::Scene scene = test::shipped_scene(
      "grasp_power_can",
      {"grasps.0.approach.time=0.1", "grasps.0.close=0.2", "grasps.0.lift.time=0.2", "grasps.0.hold=0.1",
       "solver.step=2 ms",
       "grasps.0.shake.levels=[{acceleration: 9.8, frequency: 10}, {acceleration: 19.6, frequency: 10}, "
       "{acceleration: 29.4, frequency: 10}]"});
  Simulation simulation(scene);
  Recorder recorder(simulation, with_phases(folder.path()));
  recorder.record(0);
  for (long i = 1; i <= simulation.step_count(); ++i) {
    simulation.step();
    recorder.record(i);
  }
  std::vector<Vec3> moved;
  Vec3 hold = Vec3::Zero();
  const auto palm = static_cast<std::size_t>(scene.model.hands.front().palm);
  for (const PictureState& moment : recorder.moments()) {
    if (moment.caption.starts_with("hold")) hold = moment.state.bodies[palm].p;
    if (moment.caption.starts_with("shake")) moved.push_back(moment.state.bodies[palm].p - hold);
    if (moment.caption.starts_with("shake")) {
      EXPECT_LT((moved.back() - moment.shaken).norm(), 1e-4);
    } else {
      EXPECT_TRUE(moment.shaken.isZero());
    }
  }
  ASSERT_EQ(moved.size(), 3U);
  const std::vector<model::Shake>& shakes = scene.model.drives.front().motion.shakes;
  for (std::size_t level = 0; level < 3; ++level) {
    const Vec3 amplitude = shakes[6 * level + 2 * level].amplitude;
    EXPECT_GT(moved[level].norm(), 0.9 * amplitude.norm());
    EXPECT_GT(std::abs(moved[level].normalized().dot(amplitude.normalized())), 0.99);
  }
}

// Oracle: arithmetic. 0.2 s at 30 frames a second are frames at 0, 1/30, ..., 6/30 s.
TEST(Film, HasAMomentForEachFrame) {
  if (std::system("ffmpeg -version >/dev/null 2>&1") != 0) GTEST_SKIP() << "no program ffmpeg";
  const test::TemporaryFolder folder;
  const scene::Scene scene = test::shipped_scene("two_hands", {"pictures.size=[64, 48]"});
  for (const auto& [speed, frames] : {std::pair{1.0, 7}, {0.25, 25}, {2.0, 4}}) {
    const std::filesystem::path file = folder.path() / "v.mp4";
    film_until(scene, {file, 30, speed}, 0.2, {}).write(scene.spec.pictures, {}, {});
    std::FILE* pipe = popen(
        ("ffprobe -v error -count_frames -show_entries stream=nb_read_frames -of csv=p=0 " + file.string())
            .c_str(),
        "r");
    int found = 0;
    ASSERT_EQ(std::fscanf(pipe, "%d", &found), 1);
    pclose(pipe);
    EXPECT_EQ(found, frames) << speed;
  }
}

}  // namespace
}  // namespace handsim::simulation
