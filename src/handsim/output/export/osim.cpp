#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "handsim/model/kinematics.h"
#include "handsim/model/markers.h"
#include "handsim/output/export/export.h"
#include "handsim/output/export/export_tree.h"

namespace handsim::output {

namespace {

using model::Effect;
using model::JointKind;

/// Any file of OpenSim 4 may have this version: what is written here has not changed since.
constexpr int kDocumentVersion = 40000;
constexpr double kFreeTravel = 10;       ///< range of a coordinate without a stop [m]
constexpr double kSampling = 0.01;       ///< of a driven palm's motion [s]
constexpr int kMostSamples = 2000;       ///< of the same
constexpr double kPerpendicular = 1e-9;  ///< cosine of a universal joint's axes
constexpr double kRightAngle = M_PI / 2;

/// Angles a, b, c with R = Rx(a) Ry(b) Rz(c): OpenSim's `orientation` and its free and ball coordinates.
Vec3 xyz_angles(const Quat& q) {
  const Mat3 R = q.toRotationMatrix();
  const double b = std::atan2(R(0, 2), std::hypot(R(0, 0), R(0, 1)));
  if (std::hypot(R(0, 0), R(0, 1)) < 1e-12) return {0, b, std::atan2(R(1, 0), R(1, 1))};
  return Vec3(std::atan2(-R(1, 2), R(2, 2)), b, std::atan2(-R(0, 1), R(0, 0))) + Vec3::Zero();  // no -0
}

/// The equivalent triple of angles nearest to that before: passes a right angle of the middle without a jump.
Vec3 nearest_angles(const Quat& q, const Vec3& before) {
  const auto near = [&](Vec3 angles) {
    for (int k = 0; k < 3; ++k) angles[k] += 2 * M_PI * std::round((before[k] - angles[k]) / (2 * M_PI));
    return angles;
  };
  const Vec3 found = xyz_angles(q);
  const Vec3 first = near(found), second = near({found.x() + M_PI, M_PI - found.y(), found.z() + M_PI});
  return (first - before).norm() <= (second - before).norm() ? first : second;
}

std::string place(const char* location, const Pose& pose) {
  return element(location, numbers(pose.p)) + element("orientation", numbers(xyz_angles(pose.q)));
}

/// A coordinate of a joint, in the order of OpenSim's axes. Not clamped to its range: with bounds, OpenSim's
/// inverse kinematics stops a millimetre from the markers of a hand, 0.15 rad off.
struct Coordinate {
  std::string name;
  double value = 0, speed = 0;
  double low = 0, high = 0;
  std::string prescribed;  ///< a function of time; empty: the coordinate is free
};

std::string text(const Coordinate& c) {
  std::string out = fmt::format("<Coordinate name=\"{}\">", attribute(c.name)) +
                    element("default_value", c.value) + element("default_speed_value", c.speed) +
                    element("range", fmt::format("{:.17g} {:.17g}", c.low, c.high)) +
                    element("clamped", "false");
  if (!c.prescribed.empty())
    out += element("prescribed_function", c.prescribed) + element("prescribed", "true");
  return out + "</Coordinate>";
}

class OsimWriter {
 public:
  OsimWriter(const model::Model& model, const engine::Settings& settings)
      : model_(model), settings_(settings), start_(model::initial_state(model)) {}

  std::string run() {
    check();
    const Vec3 gravity = settings_.effects.has(Effect::gravity) ? model_.gravity : Vec3::Zero();
    line(fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<OpenSimDocument Version=\"{}\">",
                     kDocumentVersion));
    line("<Model name=\"handsim\">");
    line(element("length_units", "meters") + element("force_units", "N") +
         element("gravity", numbers(gravity)));
    line("<Ground name=\"ground\">");
    visible(model::kWorld);
    line("</Ground>");
    set("BodySet", "bodyset", [&] { bodies(); });
    set("JointSet", "jointset", [&] { joints(); });
    set("ForceSet", "forceset", [&] { forces(); });
    set("MarkerSet", "markerset", [&] { markers(); });
    set("ContactGeometrySet", "contactgeometryset", [&] { contact_geometry(); });
    line("</Model>\n</OpenSimDocument>");
    return std::move(out_);
  }

 private:
  void line(const std::string& text) { out_ += text + "\n"; }

  template <class Write>
  void set(const char* tag, const char* name, Write write) {
    line(fmt::format("<{} name=\"{}\"><objects>", tag, name));
    write();
    line(fmt::format("</objects></{}>", tag));
  }

  void check() const {
    std::vector<Problem> problems;
    for (const model::Joint& each : model_.joints) {
      if (each.closes_loop)
        problems.push_back({std::nullopt, each.name, "a loop", "a tree of joints, for OpenSim"});
      if (each.type().turns == 2 && std::abs(each.axes[0].axis.dot(each.axes[1].axis)) > kPerpendicular)
        problems.push_back(
            {std::nullopt, each.name, "axes that are not perpendicular", "perpendicular axes, for OpenSim"});
    }
    if (!problems.empty()) throw Error(std::move(problems));
  }

  std::string path(int body) const {
    return body == model::kWorld ? "/ground" : "/bodyset/" + attribute(model_.bodies[as_index(body)].name);
  }

  void bodies() {
    for (std::size_t i = 1; i < model_.bodies.size(); ++i) {
      const model::Body& body = model_.bodies[i];
      const Mat3& I = body.inertia;
      line(fmt::format("<Body name=\"{}\">", attribute(body.name)));
      visible(static_cast<int>(i));
      line(element("mass", body.mass) + element("mass_center", "0 0 0") +
           element("inertia", numbers(I.diagonal()) +
                                  fmt::format(" {:.17g} {:.17g} {:.17g}", I(0, 1), I(0, 2), I(1, 2))));
      line("</Body>");
    }
  }

  /// Shapes as OpenSim draws them, each in a frame of its own.
  void visible(int body) {
    std::string frames;
    for (const model::Shape& shape : model_.shapes) {
      if (shape.body != body) continue;
      const std::string sphere = fmt::format("<Sphere>{}</Sphere>", element("radius", shape.radius));
      // OpenSim's cylinder lies along y.
      const Pose upright{Vec3::Zero(), Quat(Eigen::AngleAxisd(kRightAngle, Vec3::UnitX()))};
      const auto add = [&](const char* suffix, const Pose& pose, const std::string& geometry) {
        frames += fmt::format(
            "<PhysicalOffsetFrame name=\"{}{}\"><attached_geometry>{}</attached_geometry>"
            "<socket_parent>..</socket_parent>{}</PhysicalOffsetFrame>\n",
            attribute(shape.name), suffix, geometry, place("translation", shape.pose * pose));
      };
      switch (shape.kind) {
        case model::ShapeKind::box:
          add("", {}, fmt::format("<Brick>{}</Brick>", element("half_lengths", numbers(0.5 * shape.edges))));
          break;
        case model::ShapeKind::sphere:
          add("", {}, sphere);
          break;
        case model::ShapeKind::capsule:
          for (const bool far : {false, true}) add(far ? ".far" : ".near", end(shape, far), sphere);
          [[fallthrough]];
        case model::ShapeKind::cylinder:
          add("", upright,
              fmt::format("<Cylinder>{}{}</Cylinder>", element("radius", shape.radius),
                          element("half_height", 0.5 * shape.length)));
          break;
        case model::ShapeKind::convex_mesh:
        case model::ShapeKind::plane:
          break;  // a mesh needs a file of its own; OpenSim draws its own floor
      }
    }
    if (!frames.empty()) line("<components>\n" + frames + "</components>");
  }

  /// Centre of a capsule's cap, in the frame of the shape.
  static Pose end(const model::Shape& shape, bool far) {
    return {Vec3(0, 0, (far ? 0.5 : -0.5) * shape.length), Quat::Identity()};
  }

  void joints() {
    for (std::size_t i = 1; i < model_.bodies.size(); ++i)
      if (!has_parent(model_, i)) root(static_cast<int>(i));
    for (const model::Joint& each : model_.joints) add_joint(each);
  }

  void joint(const char* type, const std::string& name, const Pose& in_parent, int parent,
             const Pose& in_child, int child, const std::vector<Coordinate>& coordinates) {
    line(
        fmt::format("<{} name=\"{}\"><socket_parent_frame>parent_offset</socket_parent_frame>"
                    "<socket_child_frame>child_offset</socket_child_frame>",
                    type, attribute(name)));
    if (!coordinates.empty()) {
      line("<coordinates>");
      for (const Coordinate& each : coordinates) line(text(each));
      line("</coordinates>");
    }
    line("<frames>");
    const auto frame = [&](const char* of, int body, const Pose& pose) {
      line(fmt::format(
          "<PhysicalOffsetFrame name=\"{}\"><socket_parent>{}</socket_parent>{}</PhysicalOffsetFrame>", of,
          path(body), place("translation", pose)));
    };
    frame("parent_offset", parent, in_parent);
    frame("child_offset", child, in_child);
    line(fmt::format("</frames></{}>", type));
  }

  /// The frame of a body without a parent whose motion its coordinates say: of a hand the wrist's.
  Pose moving_frame(int body) const {
    for (const model::HandIndex& hand : model_.hands)
      if (hand.palm == body) return hand.wrist_frame;
    return {};
  }

  /// A body without a parent. Its coordinates are zero at the start, far from where three angles fail.
  void root(int index) {
    const model::Body& body = model_.bodies[as_index(index)];
    const model::Drive* drive = drive_of(model_, settings_, index);
    const model::BodyState& start = start_.bodies[as_index(index)];
    const Pose in_body = drive ? drive->frame : moving_frame(index);
    const Pose in_world = start.pose() * in_body;
    const std::string name = body.name + ".world";
    if (body.kinematic && !drive)
      return joint("WeldJoint", name, in_world, model::kWorld, in_body, index, {});
    std::vector<Coordinate> coordinates;
    for (const char* each : {"rx", "ry", "rz", "tx", "ty", "tz"}) {
      const double far = each[0] == 'r' ? M_PI : kFreeTravel;
      coordinates.push_back({name + "." + each, 0, 0, -far, far, ""});
    }
    if (drive) {
      prescribe(coordinates, drive->motion, in_world);
    } else {
      const Vec3 w = in_world.q.conjugate() * start.w;
      const Vec3 v = in_world.q.conjugate() * (start.v + start.w.cross(in_world.p - start.p));
      for (int k = 0; k < 3; ++k) {
        coordinates[as_index(k)].speed = w[k];
        coordinates[as_index(k + 3)].speed = v[k];
      }
    }
    joint("FreeJoint", name, in_world, model::kWorld, in_body, index, coordinates);
  }

  static void prescribe(std::vector<Coordinate>& coordinates, const model::PoseMotion& motion,
                        const Pose& start) {
    double last = std::max(motion.keys.back().time, kSampling);
    for (const model::Shake& shake : motion.shakes) last = std::max(last, shake.end());
    const int samples = std::clamp(static_cast<int>(std::ceil(last / kSampling)), 3, kMostSamples);
    std::string times;
    std::array<std::string, 6> values;
    Vec3 before = Vec3::Zero();
    for (int i = 0; i <= samples; ++i) {
      const double time = last * i / samples;
      const Pose moved = start.inverse() * motion.at(time);
      const Vec3 angles = nearest_angles(moved.q, before);
      for (int k = 0; k < 3; ++k) {
        values[as_index(k)] += fmt::format(" {:.17g}", angles[k]);
        values[as_index(k + 3)] += fmt::format(" {:.17g}", moved.p[k]);
      }
      before = angles;
      times += fmt::format(" {:.17g}", time);
    }
    for (std::size_t k = 0; k < values.size(); ++k)
      coordinates[k].prescribed = "<SimmSpline>" + element("x", times.substr(1)) +
                                  element("y", values[k].substr(1)) + "</SimmSpline>";
  }

  void add_joint(const model::Joint& each) {
    const auto& [in_parent, in_child] = std::pair(each.parent_frame, each.child_frame);
    if (model_.bodies[as_index(each.child)].kinematic)
      return joint("WeldJoint", each.name, in_parent, each.parent, in_child, each.child, {});
    const char* type = "BallJoint";
    // OpenSim's joints turn about fixed axes of their frames: a pin about z, a universal joint about x and
    // then y; a slider moves along x. At zero coordinates both frames coincide, in OpenSim and here.
    Pose turn;
    switch (each.kind) {
      case JointKind::hinge:
        type = "PinJoint";
        turn.q = rotation_between(Vec3::UnitZ(), each.axes[0].axis);
        break;
      case JointKind::universal: {
        type = "UniversalJoint";
        Mat3 R;
        R.col(0) = each.axes[0].axis;
        R.col(2) = each.axes[0].axis.cross(each.axes[1].axis).normalized();
        R.col(1) = R.col(2).cross(R.col(0));
        turn.q = Quat(R);
        break;
      }
      case JointKind::slider:
        type = "SliderJoint";
        turn.q = rotation_between(Vec3::UnitX(), each.axes[0].axis);
        break;
      case JointKind::ball:
        break;
    }
    joint(type, each.name, in_parent * turn, each.parent, in_child * turn, each.child, coordinates(each));
  }

  std::vector<Coordinate> coordinates(const model::Joint& each) const {
    std::vector<Coordinate> out;
    const double *q = start_.q.data() + each.first_dof, *u = start_.u.data() + each.first_dof;
    if (each.spherical()) {
      const Vec3 angles = xyz_angles(rotation_quaternion({q[0], q[1], q[2]}));
      for (int k = 0; k < 3; ++k)
        out.push_back({each.name + "." + "xyz"[k], angles[k], u[k], -M_PI, M_PI, ""});
      return out;
    }
    for (std::size_t i = 0; i < each.axes.size(); ++i) {
      const model::JointAxis& axis = each.axes[i];
      const double far = each.slides(i) ? kFreeTravel : M_PI;
      const bool stopped = has_stop(axis, settings_);
      out.push_back({each.name + "." + axis.name, q[i], u[i], stopped ? axis.stop->low : -far,
                     stopped ? axis.stop->high : far, ""});
    }
    return out;
  }

  /// Muscles, bands and passive tissue.
  void forces() {
    out_ += osim_muscles(model_, settings_, start_);
    if (!settings_.effects.has(Effect::passive_tissue)) return;
    for (const model::Joint& each : model_.joints)
      for (const model::JointAxis& axis : each.axes) {
        if (!axis.tissue || model_.bodies[as_index(each.child)].kinematic) continue;
        const std::string name = attribute(each.name + "." + axis.name);
        line(fmt::format("<SpringGeneralizedForce name=\"{}.tissue\">{}{}{}{}</SpringGeneralizedForce>", name,
                         element("coordinate", name), element("stiffness", axis.tissue->stiffness),
                         element("rest_length", axis.tissue->rest),
                         element("viscosity", axis.tissue->damping)));
      }
  }

  void markers() {
    for (const model::Marker& each : model::hand_markers(model_))
      line(fmt::format("<Marker name=\"{}\"><socket_parent_frame>{}</socket_parent_frame>{}</Marker>",
                       attribute(each.name), path(each.body), element("location", numbers(each.point))));
  }

  /// Spheres and planes: OpenSim has no other shapes for contact without a file.
  void contact_geometry() {
    const auto add = [&](const char* type, const model::Shape& shape, const char* suffix, const Pose& pose,
                         const std::string& more) {
      line(fmt::format("<{0} name=\"{1}{2}\"><socket_frame>{3}</socket_frame>{4}{5}</{0}>", type,
                       attribute(shape.name), suffix, path(shape.body), place("location", shape.pose * pose),
                       more));
    };
    for (const model::Shape& shape : model_.shapes) {
      const std::string radius = element("radius", shape.radius);
      if (shape.kind == model::ShapeKind::sphere) add("ContactSphere", shape, "", {}, radius);
      if (shape.kind == model::ShapeKind::capsule)
        for (const bool far : {false, true})
          add("ContactSphere", shape, far ? ".far" : ".near", end(shape, far), radius);
      // OpenSim's half space is solid where x > 0, handsim's where z < 0.
      if (shape.kind == model::ShapeKind::plane)
        add("ContactHalfSpace", shape, "",
            {Vec3::Zero(), Quat(Eigen::AngleAxisd(kRightAngle, Vec3::UnitY()))}, "");
    }
  }

  const model::Model& model_;
  const engine::Settings& settings_;
  model::State start_;
  std::string out_;
};

}  // namespace

std::string to_osim(const model::Model& model, const engine::Settings& settings) {
  return OsimWriter(model, settings).run();
}

}  // namespace handsim::output
