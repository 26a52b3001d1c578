#include <algorithm>
#include <cmath>

#include "handsim/model/kinematics.h"
#include "handsim/output/render/draw_list.h"
#include "handsim/output/render/mesh.h"
#include "handsim/output/render/skin.h"
#include "handsim/output/report/binary.h"
#include "handsim/simulation/report/run_data.h"
#include "handsim/simulation/run/pictures.h"

namespace handsim::simulation {

namespace {

constexpr const char* kPartNames[] = {"palm",   "thumb",  "index",  "middle",   "ring",
                                      "little", "object", "ground", "mechanism"};
static_assert(std::size(kPartNames) == static_cast<std::size_t>(model::Part::mechanism) + 1);

constexpr const char* kLooks[] = {"skin", "shapes", "both"};

Json numbers(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
Json pose_json(const Pose& x) { return {x.p.x(), x.p.y(), x.p.z(), x.q.x(), x.q.y(), x.q.z(), x.q.w()}; }
Json colour_json(const output::Colour& c) { return {c.r, c.g, c.b}; }

/// The hand that a body is of; null for others.
Json hand_of(const model::Model& model, int body) {
  for (const model::HandIndex& hand : model.hands)
    if (std::ranges::find(hand.bodies, body) != hand.bodies.end()) return hand.name;
  return nullptr;
}

/// Triangles of a polyhedron, three corners each.
Json hull_json(const model::ConvexMesh& mesh) {
  std::vector<float> corners;
  for (int face = 0; face < mesh.face_count(); ++face) {
    const auto loop = mesh.corners(face);
    for (std::size_t i = 1; i + 1 < loop.size(); ++i)
      for (const unsigned corner : {loop[0], loop[i], loop[i + 1]})
        for (const double x : mesh.vertex(corner)) corners.push_back(static_cast<float>(x));
  }
  return output::base64(corners);
}

Json solid_json(const output::Solid& solid) {
  Json out = {{"core", solid.core == output::Core::hull       ? "hull"
                       : solid.core == output::Core::cylinder ? "cylinder"
                                                              : "box"},
              {"half", numbers(solid.half)},
              {"round", solid.round}};
  if (solid.mesh) out["corners"] = hull_json(*solid.mesh);
  return out;
}

/// The shapes as pictures show them, each in its body's frame.
Json shapes_json(const model::Model& model, const model::State& start) {
  const output::DrawList drawn = output::draw_list(model, start, {});
  Json out = Json::array();
  for (const output::DrawShape& draw : drawn.shapes) {
    const model::Shape& shape = model.shapes[as_index(draw.shape)];
    Json entry = solid_json(output::bevelled(draw.solid));
    entry["name"] = shape.name;
    entry["body"] = shape.body;
    entry["part"] = kPartNames[static_cast<std::size_t>(shape.part)];
    entry["hand"] = hand_of(model, shape.body);
    entry["pose"] = pose_json(start.bodies[as_index(shape.body)].pose().inverse() * draw.solid.pose);
    entry["colour"] = colour_json(draw.colour);
    if (draw.mark) entry["mark"] = true;
    out.push_back(std::move(entry));
  }
  return out;
}

/// Arrows of the pictures. Each moves with the body in which its axis is fixed and whose place it has.
Json axes_json(const model::Model& model, const model::State& start) {
  const output::DrawList drawn = output::draw_list(model, start, {true});
  Json out = Json::array();
  std::size_t next = 0;
  for (const model::Joint& joint : model.joints)
    for (std::size_t axis = 0; axis < joint.axes.size(); ++axis) {
      const output::DrawArrow& arrow = drawn.arrows[next++];
      const bool before_another = !joint.slides(axis) && axis + 1 < joint.axes.size();
      const int body = before_another ? joint.parent : joint.child;
      const Pose x_BW = start.bodies[as_index(body)].pose().inverse();
      out.push_back({{"name", joint.name + "." + joint.axes[axis].name},
                     {"body", body},
                     {"from", numbers(x_BW * arrow.from)},
                     {"to", numbers(x_BW * arrow.to)},
                     {"radius", arrow.radius},
                     {"colour", colour_json(arrow.colour)}});
    }
  return out;
}

Json tips_json(const model::Model& model) {
  Json out = Json::array();
  for (const model::HandIndex& hand : model.hands)
    for (const model::Fingertip& tip : hand.fingertips)
      out.push_back({{"body", tip.body},
                     {"hand", hand.name},
                     {"part", kPartNames[static_cast<std::size_t>(tip.finger)]},
                     {"point", numbers(tip.point)}});
  return out;
}

Json bodies_json(const model::Model& model) {
  Json out = Json::array();
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const model::Body& body = model.bodies[b];
    out.push_back({{"name", b == 0 ? "world" : body.name},
                   {"mass", body.kinematic || b == 0 ? Json() : Json(body.mass)}});
  }
  return out;
}

std::vector<PictureState> moments_of(const RunFiles& run, const std::optional<RecordedContacts>& contacts,
                                     std::size_t most) {
  std::vector<PictureState> out;
  const std::size_t rows = run.times.size(), count = std::min(most, rows);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = i * (rows - 1) / std::max<std::size_t>(1, count - 1);
    out.push_back({run.state(row), {}});
    if (contacts) out.back().contacts.assign(contacts->of(row).begin(), contacts->of(row).end());
  }
  return out;
}

/// Times, targets and distances of a camera that follows the hand as in a video; null for one that stands.
Json path_json(const std::vector<PictureState>& moments, const std::vector<output::Camera>& cameras) {
  std::vector<float> times, values;
  bool moves = false;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const output::Camera& camera = cameras[i];
    moves = moves || camera.target != cameras[0].target || camera.position != cameras[0].position;
    times.push_back(static_cast<float>(moments[i].state.time));
    for (const double x : camera.target) values.push_back(static_cast<float>(x));
    values.push_back(static_cast<float>((camera.position - camera.target).norm()));
  }
  if (!moves) return nullptr;
  return {{"times", output::base64(times)}, {"values", output::base64(values)}};
}

/// The camera of the start, and how it follows.
Json camera_json(const RunFiles& run, const std::optional<RecordedContacts>& contacts, const Stage& stage) {
  // As many as follow every motion of an arm.
  constexpr std::size_t kMost = 400;
  /// A camera looks this far ahead and back [s].
  constexpr double kSmooth = 0.5;
  const std::vector<PictureState> moments = moments_of(run, contacts, kMost);
  const double spacing = (run.times.back() - run.times.front()) /
                         static_cast<double>(std::max<std::size_t>(1, moments.size() - 1));
  const auto reach = spacing > 0 ? static_cast<std::size_t>(std::lround(kSmooth / spacing)) : 0;
  const std::vector<output::Camera> along =
      cameras({run.scene.model, run.scene.spec.pictures}, moments, reach);
  Json path = path_json(moments, along);
  const output::Camera& camera = path.is_null() ? stage.camera : along.front();
  const auto& size = run.scene.spec.pictures.size;
  return {{"position", numbers(camera.position)},
          {"target", numbers(camera.target)},
          {"up", numbers(camera.up)},
          {"field_of_view", camera.field_of_view},
          {"aspect", static_cast<double>(size[0]) / size[1]},
          {"path", std::move(path)}};
}

/// Unit meshes of the pictures: points of the core and normals in turn, and triangles.
Json mesh_json(const output::Mesh& mesh) {
  std::vector<float> numbers;
  std::vector<std::uint16_t> indices;
  for (const output::Vertex& vertex : mesh.vertices) {
    for (const float x : vertex.core) numbers.push_back(x);
    for (const float x : vertex.normal) numbers.push_back(x);
  }
  for (const std::uint32_t index : mesh.indices) indices.push_back(static_cast<std::uint16_t>(index));
  return {{"vertices", output::base64(numbers)}, {"indices", output::base64(indices)}};
}

/// A hand's skin: points in steps of their box, triangles, and the four strongest bodies of each point as
/// 1024 times the body and 1023 times its share.
Json mesh_of_skin_json(const output::Skin& skin) {
  Vec3 low = skin.points[0], high = low;
  for (const Vec3& point : skin.points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const Vec3 step = (high - low) / 65535;
  std::vector<std::uint16_t> points, faces, influences;
  for (std::size_t i = 0; i < skin.points.size(); ++i) {
    for (const double x : (skin.points[i] - low).cwiseQuotient(step))
      points.push_back(static_cast<std::uint16_t>(std::lround(x)));
    Eigen::VectorXf shares = skin.weights.row(static_cast<long>(i));
    for (int k = 0; k < 4; ++k) {
      long body = 0;
      const float share = shares.maxCoeff(&body);
      influences.push_back(static_cast<std::uint16_t>(1024 * body + std::lround(1023 * share)));
      shares[body] = 0;
    }
  }
  for (const auto& face : skin.faces)
    for (const std::uint32_t corner : face) faces.push_back(static_cast<std::uint16_t>(corner));
  return {{"low", numbers(low)},
          {"step", numbers(step)},
          {"points", output::base64(points)},
          {"faces", output::base64(faces)},
          {"influences", output::base64(influences)}};
}

bool mirror_images(const output::Skin& a, const output::Skin& b) {
  return std::ranges::equal(a.points, b.points, {}, {}, [](const Vec3& x) { return mirrored(x); });
}

Json skins_json(const scene::Scene& scene) {
  Json out = Json::array();
  if (scene.spec.pictures.hands == scene::HandLook::shapes) return out;
  const auto skins = output::skins_of(scene.model);
  for (std::size_t i = 0; i < skins.size(); ++i) {
    // The mesh of a hand that is the mirror image of an earlier one is written once.
    std::size_t like = 0;
    while (!mirror_images(*skins[i], *skins[like]) && like < i) ++like;
    out.push_back({{"bodies", skins[i]->bodies},
                   {"rest", Json::array()},
                   {"tone", colour_json(output::from_srgb(scene.spec.pictures.skin_colour))},
                   {"hand", hand_of(scene.model, skins[i]->bodies[0])}});
    for (const Pose& x : skins[i]->rest) out.back()["rest"].push_back(pose_json(x));
    out.back().update(like < i ? Json{{"mirror_of", like}} : mesh_of_skin_json(*skins[i]));
  }
  return out;
}

}  // namespace

Json scene_json(const RunFiles& run, const std::optional<RecordedContacts>& contacts) {
  const model::Model& model = run.scene.model;
  const model::State start = model::initial_state(model);
  // As many as a contact sheet shows.
  const Stage stage = stage_of({run.scene.model, run.scene.spec.pictures}, moments_of(run, {}, 24));
  constexpr int kSides = 24;
  return {{"bodies", bodies_json(model)},
          {"shapes", shapes_json(model, start)},
          {"axes", axes_json(model, start)},
          {"tips", tips_json(model)},
          {"skins", skins_json(run.scene)},
          {"look", kLooks[static_cast<std::size_t>(run.scene.spec.pictures.hands)]},
          {"finger_colours", run.scene.spec.pictures.finger_colours},
          {"meshes",
           {{"capsule", mesh_json(output::capsule_mesh(kSides))},
            {"box", mesh_json(output::box_mesh())},
            {"cylinder", mesh_json(output::cylinder_mesh(kSides))}}},
          {"ground", stage.ground ? Json(*stage.ground) : Json()},
          {"floor_is_drawn_only", !run.scene.spec.ground},
          {"camera", camera_json(run, contacts, stage)}};
}

Json poses_json(const RunFiles& run) {
  const model::Model& model = run.scene.model;
  const std::size_t rows = run.times.size();
  const model::State start = model::initial_state(model);
  std::vector<std::size_t> moving;
  Json fixed = Json::array();
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    const std::size_t column = run.first_pose() + 7 * (b - 1);
    bool moves = false;
    for (std::size_t row = 1; b > 0 && row < rows && !moves; ++row)
      for (std::size_t i = 0; i < 7; ++i)
        moves = moves || run.trajectory.at(row, column + i) != run.trajectory.at(0, column + i);
    if (moves) moving.push_back(b);
    fixed.push_back(moves ? Json() : pose_json(b == 0 ? Pose{} : run.state(0).bodies[b].pose()));
  }
  std::vector<float> values;
  std::vector<double> tolerances;
  for (const std::size_t b : moving) {
    double reach = 0.01;
    for (const model::Shape& shape : model.shapes)
      if (as_index(shape.body) == b && shape.kind != model::ShapeKind::plane) {
        const output::Solid solid = output::solid(shape, shape.pose);
        reach = std::max(reach, solid.pose.p.norm() + solid.reach());
      }
    // A change of a quaternion's components by e turns by about 2 e.
    tolerances.insert(tolerances.end(), 3, kPoseTolerance / 2);
    tolerances.insert(tolerances.end(), 4, kPoseTolerance / 4 / reach);
  }
  for (std::size_t row = 0; row < rows; ++row)
    for (const std::size_t b : moving) {
      const std::size_t column = run.first_pose() + 7 * (b - 1);
      const auto value = [&](std::size_t i) {
        return static_cast<float>(run.trajectory.at(row, column + i));
      };
      float pose[] = {value(0), value(1), value(2), value(4), value(5), value(6), value(3)};
      // A rotation has two quaternions: takes the one near the row before.
      if (row > 0) {
        const std::span<const float> before = std::span<const float>(values).last(7 * moving.size());
        float dot = 0;
        for (std::size_t i = 3; i < 7; ++i) dot += pose[i] * before[i];
        if (dot < 0)
          for (std::size_t i = 3; i < 7; ++i) pose[i] = -pose[i];
      }
      values.insert(values.end(), pose, pose + 7);
    }
  const std::size_t width = 7 * moving.size();
  const auto most = static_cast<std::size_t>(kPoseBytes / (4.0 * static_cast<double>(width + 1)));
  const output::Thinned thin = output::thinned(run.times, values, tolerances, most);
  std::vector<float> times, kept;
  for (const std::size_t row : thin.rows) {
    times.push_back(static_cast<float>(run.times[row]));
    kept.insert(kept.end(), values.begin() + static_cast<std::ptrdiff_t>(row * width),
                values.begin() + static_cast<std::ptrdiff_t>((row + 1) * width));
  }
  return {{"moving", moving},
          {"fixed", fixed},
          {"times", output::base64(times)},
          {"values", output::base64(kept)},
          {"recorded", rows},
          {"every", run.scene.spec.record_every},
          {"tolerance", kPoseTolerance * thin.factor}};
}

}  // namespace handsim::simulation
