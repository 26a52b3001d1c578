// Simbody: mobilized bodies in joint coordinates, each loop closed by a ball constraint. Methods
// `runge_kutta_merson` (with the setting `accuracy`: error-controlled; without: fixed step) and
// `semi_explicit_euler` (fixed step). The setting `constraint_tolerance` takes the place of Simbody's default
// (1e-4 with a fixed step, else a tenth of the accuracy).
#include <Simbody.h>

#include <stdexcept>

#include "peer.h"

namespace {

using peer::Joint;
using peer::Request;
using SimTK::Transform;

SimTK::Vec3 vector_of(const peer::Vec3& v) { return {v.x(), v.y(), v.z()}; }
peer::Vec3 vector_of(const SimTK::Vec3& v) { return {v[0], v[1], v[2]}; }

SimTK::Rotation rotation_of(const Eigen::Quaterniond& q) {
  return SimTK::Rotation(SimTK::Quaternion(q.w(), q.x(), q.y(), q.z()));
}

Transform pose_of(const peer::Body& body) {
  return Transform(rotation_of(body.orientation), vector_of(body.position));
}

/// The joint's frame in the world at the start, its axes where Simbody's joint of this kind has them: Pin z,
/// Slider x, Universal x and y.
Transform joint_frame(const Joint& joint) {
  SimTK::Rotation rotation;
  const SimTK::UnitVec3 first(vector_of(joint.axes[0]));
  switch (joint.kind) {
    case peer::JointKind::hinge:
      rotation = SimTK::Rotation(first, SimTK::ZAxis);
      break;
    case peer::JointKind::slider:
      rotation = SimTK::Rotation(first, SimTK::XAxis);
      break;
    case peer::JointKind::universal:
      rotation = SimTK::Rotation(first, SimTK::XAxis, vector_of(joint.axes[1]), SimTK::YAxis);
      break;
    case peer::JointKind::ball:
      break;
  }
  return Transform(rotation, vector_of(joint.anchor));
}

class Mechanism final : public peer::Mechanism {
 public:
  explicit Mechanism(const Request& request)
      : step_(request.step), matter_(system_), forces_(system_), bodies_(request.bodies.size()) {
    matter_.setShowDefaultGeometry(false);
    SimTK::Force::Gravity(forces_, matter_, vector_of(request.gravity));
    for (const Joint& joint : request.joints) add(request, joint);
    SimTK::State state = system_.realizeTopology();
    for (const Joint& joint : request.joints) {
      const std::vector<double> rates = request.rates(joint);
      for (std::size_t a = 0; a < rates.size(); ++a)
        body(joint.child).setOneU(state, static_cast<int>(a), rates[a]);
    }
    integrator_ = make_integrator(request);
    integrator_->initialize(state);
  }

  void run(long steps) override {
    if (fixed_) {
      peer::Mechanism::run(steps);
      return;
    }
    count_ += steps;
    const double end = static_cast<double>(count_) * step_;
    while (integrator_->getTime() < end) integrator_->stepTo(end);
  }

  void step() override {
    if (!fixed_) {
      run(1);
      return;
    }
    const double before = integrator_->getTime();
    while (integrator_->getTime() <= before) integrator_->stepTo(SimTK::Infinity);
  }

  double time() const override { return integrator_->getTime(); }

  std::vector<peer::BodyState> state() override {
    const SimTK::State& state = integrator_->getState();
    system_.realize(state, SimTK::Stage::Velocity);
    std::vector<peer::BodyState> out;
    for (const SimTK::MobilizedBodyIndex index : bodies_) {
      const SimTK::MobilizedBody& body = matter_.getMobilizedBody(index);
      const SimTK::Quaternion q = body.getBodyRotation(state).convertRotationToQuaternion();
      out.push_back({vector_of(body.getBodyOriginLocation(state)), Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                     vector_of(body.getBodyOriginVelocity(state)),
                     vector_of(body.getBodyAngularVelocity(state))});
    }
    return out;
  }

  double kinetic_energy() override {
    system_.realize(integrator_->getState(), SimTK::Stage::Velocity);
    return matter_.calcKineticEnergy(integrator_->getState());
  }

 private:
  SimTK::MobilizedBody& body(int index) {
    return index == peer::kGround ? matter_.updMobilizedBody(SimTK::GroundIndex)
                                  : matter_.updMobilizedBody(bodies_[static_cast<std::size_t>(index)]);
  }

  void add(const Request& request, const Joint& joint) {
    const peer::Body& child = request.child(joint);
    const Eigen::Vector3d in_parent = request.parent_pose(joint).inverse() * joint.anchor;
    const Eigen::Vector3d in_child = child.pose().inverse() * joint.anchor;
    if (joint.closes_loop) {
      SimTK::Constraint::Ball(body(joint.parent), vector_of(in_parent), body(joint.child),
                              vector_of(in_child));
      return;
    }
    const Eigen::Matrix3d& i = child.inertia;
    const SimTK::Body::Rigid rigid(SimTK::MassProperties(
        child.mass, SimTK::Vec3(0), SimTK::Inertia(i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2))));
    const Transform frame = joint_frame(joint);
    const Transform parent = joint.parent == peer::kGround
                                 ? Transform()
                                 : pose_of(request.bodies[static_cast<std::size_t>(joint.parent)]);
    const Transform in_f = ~parent * frame, in_m = ~pose_of(child) * frame;
    SimTK::MobilizedBodyIndex& index = bodies_[static_cast<std::size_t>(joint.child)];
    switch (joint.kind) {
      case peer::JointKind::hinge:
        index = SimTK::MobilizedBody::Pin(body(joint.parent), in_f, rigid, in_m);
        break;
      case peer::JointKind::slider:
        index = SimTK::MobilizedBody::Slider(body(joint.parent), in_f, rigid, in_m);
        break;
      case peer::JointKind::universal:
        index = SimTK::MobilizedBody::Universal(body(joint.parent), in_f, rigid, in_m);
        break;
      case peer::JointKind::ball:
        break;
    }
    for (std::size_t a = 0; a < joint.forces.size(); ++a)
      if (joint.forces[a] != 0)
        SimTK::Force::MobilityConstantForce(forces_, body(joint.child),
                                            SimTK::MobilizerUIndex(static_cast<int>(a)), joint.forces[a]);
  }

  std::unique_ptr<SimTK::Integrator> make_integrator(const Request& request) {
    std::unique_ptr<SimTK::Integrator> integrator;
    fixed_ = !request.has("accuracy");
    if (request.method == "runge_kutta_merson")
      integrator = std::make_unique<SimTK::RungeKuttaMersonIntegrator>(system_);
    else if (request.method == "semi_explicit_euler" && fixed_)
      integrator = std::make_unique<SimTK::SemiExplicitEulerIntegrator>(system_, request.step);
    else
      throw std::runtime_error(
          "Simbody has methods runge_kutta_merson and, of fixed step, semi_explicit_euler");
    if (fixed_) {
      integrator->setFixedStepSize(request.step);
      integrator->setReturnEveryInternalStep(true);
    } else {
      integrator->setAccuracy(request.setting("accuracy", 0));
    }
    if (request.has("constraint_tolerance"))
      integrator->setConstraintTolerance(request.setting("constraint_tolerance", 0));
    return integrator;
  }

  double step_;
  bool fixed_ = true;
  long count_ = 0;  ///< steps asked for of an error-controlled method, which takes its own
  SimTK::MultibodySystem system_;
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  std::vector<SimTK::MobilizedBodyIndex> bodies_;
  std::unique_ptr<SimTK::Integrator> integrator_;
};

std::unique_ptr<peer::Mechanism> make(const Request& request) { return std::make_unique<Mechanism>(request); }

}  // namespace

int main() {
  int major = 0, minor = 0, build = 0;
  SimTK_version_simbody(&major, &minor, &build);
  return peer::serve({"Simbody",
                      std::to_string(major) + "." + std::to_string(minor),
                      {"accuracy", "constraint_tolerance"},
                      make});
}
