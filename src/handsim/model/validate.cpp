#include "handsim/model/validate.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include <fmt/format.h>

namespace handsim::model {

namespace {

// Outside these bounds ODE aborts (mass below 1e-12) or rounding leaves no correct digits.
constexpr double kMassMin = 1e-9, kMassMax = 1e6;
constexpr double kSizeMin = 1e-6, kSizeMax = 1e4;
constexpr double kFar = 1e6;
constexpr double kBeyondFiles = 100;  ///< largest value of a program over that of a file
constexpr double kStiffnessMax = 1e12;
constexpr double kUnitTolerance = 1e-9;

/// A key in messages, put together only for a problem.
struct Key {
  std::string_view part, quantity, of = {};
};

class Checker {
 public:
  Checker(const Model& model, const Origins& origins) : model_(model), origins_(origins) {}

  std::vector<Problem> run() {
    check_vector({"gravity", ""}, model_.gravity);
    if (model_.bodies.empty()) add("bodies", "none", "the world as body 0");
    each(model_.bodies, origins_.bodies, [&](const Body& body) {
      if (&body != &model_.bodies.front()) check_body(body);
    });
    int first_dof = 0;
    each(model_.joints, origins_.joints, [&](const Joint& joint) {
      check_joint(joint);
      if (joint.first_dof != first_dof)
        add(joint.name + ".first_dof", fmt::format("{}", joint.first_dof),
            fmt::format("{}, the coordinates of the joints before it", first_dof));
      first_dof += dof_count(joint.kind);
    });
    check_order();
    each(model_.shapes, origins_.shapes, [&](const Shape& shape) { check_shape(shape); });
    each(model_.materials, origins_.materials, [&](const Material& material) { check_material(material); });
    for (const Muscle& muscle : model_.muscles) check_muscle(muscle);
    for (const Band& band : model_.bands) check_band(band);
    for (const ContactRule& rule : model_.contact_rules)
      if (!in(rule.group_a, model_.groups) || !in(rule.group_b, model_.groups))
        add("contact_rules", fmt::format("groups {}, {}", rule.group_a, rule.group_b), "indices of groups");
      else if (rule.material && !in(*rule.material, model_.materials))
        add("contact_rules", fmt::format("material {}", *rule.material), "the index of a material");
    for (const Drive& drive : model_.drives) check_drive(drive);
    return std::move(problems_);
  }

 private:
  template <class T>
  static bool in(int index, const std::vector<T>& list) {
    return index >= 0 && as_index(index) < list.size();
  }

  /// Checks each part, with its place for the problems.
  template <class T, class Check>
  void each(const std::vector<T>& parts, const std::vector<std::optional<Place>>& places, Check check) {
    for (std::size_t i = 0; i < parts.size(); ++i) {
      place_ = i < places.size() ? places[i] : std::nullopt;
      check(parts[i]);
    }
    place_.reset();
  }

  void add(std::string key, std::string got, std::string need) {
    problems_.push_back({place_, std::move(key), std::move(got), std::move(need)});
  }
  void add(const Key& key, std::string got, std::string need) {
    add(fmt::format("{}{}{}", key.part, key.quantity, key.of), std::move(got), std::move(need));
  }

  void check_vector(const Key& key, const Vec3& v) {
    if (!v.allFinite() || v.norm() > kFar)
      add(key, fmt::format("({}, {}, {})", v.x(), v.y(), v.z()),
          fmt::format("finite numbers below {:g}", kFar));
  }

  void check_pose(std::string_view part, std::string_view frame, const Pose& pose) {
    check_vector({part, frame, ".position"}, pose.p);
    if (!pose.q.coeffs().allFinite() || std::abs(pose.q.norm() - 1) > kUnitTolerance)
      add({part, frame, ".rotation"}, fmt::format("a quaternion of length {:.12g}", pose.q.norm()),
          "a unit quaternion");
  }

  void check_range(const Key& key, double value, double low, double high, const char* unit) {
    if (!(value >= low && value <= high))
      add(key, fmt::format("{:g} {}", value, unit), fmt::format("{:g} to {:g} {}", low, high, unit));
  }

  void check_body(const Body& body) {
    check_pose(body.name, ".zero_pose", body.zero_pose);
    check_vector({body.name, ".initial_velocity"}, body.initial_velocity);
    check_vector({body.name, ".initial_angular_velocity"}, body.initial_angular_velocity);
    check_range({body.name, ".mass"}, body.mass, kMassMin, kMassMax, "kg");
    check_inertia(body);
  }

  void check_inertia(const Body& body) {
    const std::string key = body.name + ".inertia";
    if (!body.inertia.allFinite()) return add(key, "a number that is not finite", "finite numbers");
    const double scale = body.inertia.cwiseAbs().maxCoeff();
    if (!(body.inertia - body.inertia.transpose()).isZero(1e-9 * scale))
      return add(key, "a matrix that is not symmetric", "a symmetric matrix");
    const Vec3 principal =
        Eigen::SelfAdjointEigenSolver<Mat3>(body.inertia, Eigen::EigenvaluesOnly).eigenvalues();
    // A rigid body's two smaller principal moments sum to at least the largest.
    if (!(principal[0] > 0) || principal[2] > (principal[0] + principal[1]) * (1 + 1e-9))
      add(key,
          fmt::format("principal moments {:g}, {:g}, {:g} kg m^2", principal[0], principal[1], principal[2]),
          "positive moments of which none exceeds the sum of the other two");
  }

  void check_axis(const Key& key, const Vec3& axis) {
    if (!axis.allFinite() || std::abs(axis.norm() - 1) > kUnitTolerance)
      add(key, fmt::format("({}, {}, {})", axis.x(), axis.y(), axis.z()), "a unit vector");
  }

  void check_joint(const Joint& joint) {
    if (!in(joint.parent, model_.bodies) || !in(joint.child, model_.bodies) || joint.parent == joint.child ||
        joint.child == kWorld)
      add(joint.name, fmt::format("bodies {} and {}", joint.parent, joint.child),
          "two different bodies, the child not the world");
    check_pose(joint.name, ".parent_frame", joint.parent_frame);
    check_pose(joint.name, ".child_frame", joint.child_frame);
    const std::size_t axes = joint.type().axes();
    if (joint.axes.size() != axes)
      return add(joint.name + ".axes", fmt::format("{} axes", joint.axes.size()), fmt::format("{}", axes));
    for (std::size_t k = 0; k < axes; ++k) {
      const JointAxis& axis = joint.axes[k];
      check_joint_axis(joint.name + "." + axis.name, axis);
      if (axis.stop && !joint.slides(k)) check_angle_stop(joint.name + "." + axis.name, *axis.stop);
    }
    if (!joint.type().perpendicular()) return;
    const double cosine = joint.axes[axes - 2].axis.dot(joint.axes[axes - 1].axis);
    if (!(std::abs(cosine) < kUnitTolerance))
      add(joint.name + ".axes", fmt::format("axes with cosine {:g}", cosine), "perpendicular axes");
  }

  void check_joint_axis(const std::string& key, const JointAxis& axis) {
    check_axis({key, ".axis"}, axis.axis);
    check_range({key, ".initial"}, axis.initial, -kFar, kFar, "rad or m");
    if (axis.stop) {
      if (!(axis.stop->low < axis.stop->high))
        add(key + ".stop", fmt::format("{:g}..{:g}", axis.stop->low, axis.stop->high), "low below high");
      check_range({key, ".stop.restitution"}, axis.stop->restitution, 0, 1, "");
      check_range({key, ".stop.motor_share"}, axis.stop->motor_share, 0, 1, "");
    }
    if (axis.tissue) {
      check_range({key, ".tissue.stiffness"}, axis.tissue->stiffness, 0, kFar, "N m/rad");
      check_range({key, ".tissue.damping"}, axis.tissue->damping, 0, kFar, "N m s/rad");
      check_range({key, ".tissue.rest"}, axis.tissue->rest, -kFar, kFar, "rad");
    }
  }

  /// Angles are in (-pi, pi]: a finite stop outside would never act.
  void check_angle_stop(const std::string& key, const Stop& stop) {
    for (const double value : {stop.low, stop.high})
      if (std::isfinite(value) && std::abs(value) > M_PI)
        add(key + ".stop", fmt::format("{:g} rad", value), "-pi to pi, or infinite for no stop on that side");
  }

  void check_order() {
    std::vector<bool> placed(model_.bodies.size(), false);
    std::vector<bool> is_child(model_.bodies.size(), false);
    each(model_.joints, origins_.joints, [&](const Joint& joint) {
      if (!joint.closes_loop && in(joint.child, model_.bodies)) {
        if (is_child[as_index(joint.child)])
          add(joint.name, "a child that another joint already has", "closes_loop");
        is_child[as_index(joint.child)] = true;
      }
    });
    for (std::size_t i = 0; i < placed.size(); ++i) placed[i] = !is_child[i];
    each(model_.joints, origins_.joints, [&](const Joint& joint) {
      if (joint.closes_loop || !in(joint.child, model_.bodies) || !in(joint.parent, model_.bodies)) return;
      if (!placed[as_index(joint.parent)])
        add(joint.name, "a parent that comes later", "parents before children");
      placed[as_index(joint.child)] = true;
    });
  }

  void check_shape(const Shape& shape) {
    check_pose(shape.name, ".pose", shape.pose);
    if (!in(shape.body, model_.bodies) || !in(shape.group, model_.groups) ||
        !in(shape.material, model_.materials))
      add(shape.name, fmt::format("body {}, group {}, material {}", shape.body, shape.group, shape.material),
          "indices within the model");
    const bool round = shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::cylinder ||
                       shape.kind == ShapeKind::sphere;
    if (round) check_range({shape.name, ".radius"}, shape.radius, kSizeMin, kSizeMax, "m");
    if (shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::cylinder)
      check_range({shape.name, ".length"}, shape.length, kSizeMin, kSizeMax, "m");
    if (shape.kind == ShapeKind::convex_mesh && (!shape.mesh || !(shape.mesh->volume > 0)))
      add(shape.name + ".mesh", shape.mesh ? "a mesh without volume" : "none", "a convex mesh");
    if (shape.kind == ShapeKind::box)
      for (int i = 0; i < 3; ++i)
        check_range({shape.name, ".edges"}, shape.edges[i], kSizeMin, kSizeMax, "m");
  }

  void check_material(const Material& material) {
    Material::fields([&](std::string_view key, auto member, const Quantity& range, auto...) {
      const std::optional<double> value = field_value(material, member);
      // A law in its place.
      if (key == "stiffness" && material.compliance && material.compliance->law) return;
      // A file's range ends where a typing error is likely; a program may go beyond it. Shares and lengths
      // stay.
      Quantity wide = range;
      if (range.max > 1) wide.max *= kBeyondFiles;
      if (value && !wide.allows(*value))
        add({material.name, ".", key}, fmt::format("{:g}", *value), wide.need());
    });
  }

  void check_drive(const Drive& drive) {
    const bool known = in(drive.body, model_.bodies);
    const std::string key = known ? model_.bodies[as_index(drive.body)].name + ".drive" : "drive";
    if (!known || drive.body == kWorld || !model_.bodies[as_index(drive.body)].kinematic)
      add(key, fmt::format("body {}", drive.body), "a kinematic body other than the world");
    check_pose(key, ".frame", drive.frame);
    if (drive.motion.keys.empty()) add(key + ".motion", "no keyframe", "at least one");
    for (std::size_t i = 0; i < drive.motion.keys.size(); ++i) {
      check_pose(key, ".motion", drive.motion.keys[i].pose);
      check_range({key, ".motion.time"}, drive.motion.keys[i].time, -kFar, kFar, "s");
      if (i > 0 && !(drive.motion.keys[i].time > drive.motion.keys[i - 1].time))
        add(key + ".motion",
            fmt::format("time {:g} after {:g}", drive.motion.keys[i].time, drive.motion.keys[i - 1].time),
            "increasing times");
    }
    for (const Shake& shake : drive.motion.shakes) {
      check_range({key, ".motion.shake"}, shake.frequency, 1e-3, 1e4, "Hz");
      check_range({key, ".motion.shake"}, shake.amplitude.norm(), 0, kFar, "m");
      if (shake.cycles < 1)
        add(key + ".motion.shake", fmt::format("{} cycles", shake.cycles), "at least one");
    }
  }

  void check_path(const std::string& name, const TendonPath& path) {
    if (path.arms.size() > kMostArms)
      add(name, fmt::format("{} moment arms", path.arms.size()), fmt::format("at most {}", kMostArms));
    for (std::size_t i = 0; i < path.arms.size(); ++i) {
      const MomentArm& arm = path.arms[i];
      if (arm.dof < 0 || arm.dof >= model_.dof_count())
        add(name + ".arms", fmt::format("coordinate {}", arm.dof), "a coordinate of the model");
      for (std::size_t j = 0; j < i; ++j)
        if (path.arms[j].dof == arm.dof)
          add(name + ".arms", fmt::format("coordinate {} twice", arm.dof), "each coordinate once");
      for (const double c : arm.c) check_range({name, ".arms"}, c, -kSizeMax, kSizeMax, "m");
    }
    const int arms = static_cast<int>(path.arms.size());
    for (const ArmProduct& each : path.products)
      if (each.a < 0 || each.b < 0 || each.a >= arms || each.b >= arms || each.a == each.b ||
          std::min(each.power_a, each.power_b) < 1 || std::max(each.power_a, each.power_b) > kArmTerms ||
          !std::isfinite(each.factor))
        add(name + ".products", "a product that is not sound", "two arms of the path and powers of 1 to 5");
  }

  void check_muscle(const Muscle& muscle) {
    check_path(muscle.name, muscle.path);
    check_range({muscle.name, ".force"}, muscle.force, 1e-6, 1e6, "N");
    check_range({muscle.name, ".fibre_length"}, muscle.fibre_length, 1e-5, kSizeMax, "m");
    check_range({muscle.name, ".length"}, muscle.length, 0, kSizeMax, "m");
    check_range({muscle.name, ".slack_length"}, muscle.slack_length, 0, kSizeMax, "m");
    check_range({muscle.name, ".pennation"}, muscle.pennation, 0, 1.4, "rad");
    check_range({muscle.name, ".activation_time"}, muscle.activation_time, 1e-6, 10, "s");
    check_range({muscle.name, ".deactivation_time"}, muscle.deactivation_time, 1e-6, 10, "s");
    check_range({muscle.name, ".max_speed"}, muscle.max_speed, 0.01, 1e3, "1/s");
    check_range({muscle.name, ".initial"}, muscle.initial, 0, 1, "");
    check_range({muscle.name, ".excitable"}, muscle.excitable, 0, 1, "");
    check_range({muscle.name, ".common_drive"}, muscle.common_drive, 0, 1, "");
    check_range({muscle.name, ".effort"}, muscle.effort, 0, 1, "");
    for (const Spill& each : muscle.spills) {
      check_range({muscle.name, ".spills.share"}, each.share, 0, 1, "");
      if (each.from < 0 || each.from >= static_cast<int>(model_.muscles.size()))
        add(muscle.name + ".spills", fmt::format("from muscle {}", each.from), "a muscle of the model");
    }
    if (muscle.short_range)
      check_range({muscle.name, ".short_range"}, *muscle.short_range, kLeastShortRange, kMostShortRange, "");
    if (muscle.tendon_strain) {
      check_range({muscle.name, ".tendon_strain"}, *muscle.tendon_strain, kLeastTendonStrain,
                  kMostTendonStrain, "");
      check_range({muscle.name, ".slack_length"}, muscle.slack_length, 1e-9, kSizeMax, "m");
    }
  }

  void check_band(const Band& band) {
    check_path(band.name, band.path);
    check_range({band.name, ".stiffness"}, band.stiffness, 0, kStiffnessMax, "N/m");
    check_range({band.name, ".damping"}, band.damping, 0, kStiffnessMax, "N s/m");
    check_range({band.name, ".rest"}, band.rest, -kSizeMax, kSizeMax, "m");
  }

  const Model& model_;
  const Origins& origins_;
  std::optional<Place> place_;  ///< of the part that is being checked
  std::vector<Problem> problems_;
};

}  // namespace

void Origins::add(const Model& model, const std::optional<Place>& place) {
  bodies.resize(model.bodies.size(), place);
  joints.resize(model.joints.size(), place);
  shapes.resize(model.shapes.size(), place);
  materials.resize(model.materials.size(), place);
}

std::vector<Problem> defects(const Model& model, const Origins& origins) {
  return Checker(model, origins).run();
}

}  // namespace handsim::model
