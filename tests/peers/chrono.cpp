// Project Chrono (10; names as since 9): bodies in maximal coordinates, a direct solver. Methods
// `euler_linearised`, `euler_projected` and `hht` (without step control). Written to Chrono's published
// interface; there is no package of it, so that ./dev test does not build it.
#include <chrono/physics/ChBody.h>
#include <chrono/physics/ChLinkLock.h>
#include <chrono/physics/ChLinkUniversal.h>
#include <chrono/physics/ChLoadContainer.h>
#include <chrono/physics/ChLoadsBody.h>
#include <chrono/physics/ChSystemNSC.h>
#include <chrono/solver/ChDirectSolverLS.h>
#include <chrono/timestepper/ChTimestepperHHT.h>

#include <stdexcept>

#include "peer.h"

namespace {

using chrono_types::make_shared;
using peer::Joint;
using peer::Request;

chrono::ChVector3d vector_of(const peer::Vec3& v) { return {v.x(), v.y(), v.z()}; }
peer::Vec3 vector_of(const chrono::ChVector3d& v) { return {v.x(), v.y(), v.z()}; }

/// The joint's frame in the world at the start, its axes where Chrono's joint of this kind has them: revolute
/// and prismatic z, universal x and y.
chrono::ChFramed joint_frame(const Joint& joint) {
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  if (joint.kind == peer::JointKind::universal) {
    Eigen::Matrix3d axes;
    axes << joint.axes[0], joint.axes[1], joint.axes[0].cross(joint.axes[1]);
    turn = Eigen::Quaterniond(axes);
  } else if (joint.kind != peer::JointKind::ball) {
    turn.setFromTwoVectors(peer::Vec3::UnitZ(), joint.axes[0]);
  }
  return {vector_of(joint.anchor), chrono::ChQuaterniond(turn.w(), turn.x(), turn.y(), turn.z())};
}

class Mechanism final : public peer::Mechanism {
 public:
  explicit Mechanism(const Request& request) : step_(request.step) {
    system_.SetGravitationalAcceleration(vector_of(request.gravity));
    ground_->SetFixed(true);
    system_.AddBody(ground_);
    system_.Add(loads_);
    for (const peer::Body& body : request.bodies) add(body);
    for (const Joint& joint : request.joints) add(joint);
    system_.SetSolver(make_shared<chrono::ChSolverSparseLU>());
    choose(request.method);
    // HHT would start from accelerations of zero.
    system_.DoAssembly(chrono::AssemblyLevel::FULL);
  }

  void step() override {
    if (!system_.DoStepDynamics(step_)) throw std::runtime_error("Chrono: a step failed");
  }
  double time() const override { return system_.GetChTime(); }

  std::vector<peer::BodyState> state() override {
    std::vector<peer::BodyState> out;
    for (const auto& body : bodies_) {
      const chrono::ChQuaterniond& q = body->GetRot();
      out.push_back({vector_of(body->GetPos()), Eigen::Quaterniond(q.e0(), q.e1(), q.e2(), q.e3()),
                     vector_of(body->GetPosDt()), vector_of(body->GetAngVelParent())});
    }
    return out;
  }

  double kinetic_energy() override {
    double sum = 0;
    for (const auto& body : bodies_) {
      const peer::Vec3 v = vector_of(body->GetPosDt()), w = vector_of(body->GetAngVelLocal());
      const Eigen::Matrix3d inertia = body->GetInertia();
      sum += 0.5 * (body->GetMass() * v.squaredNorm() + w.dot(inertia * w));
    }
    return sum;
  }

 private:
  std::shared_ptr<chrono::ChBody> body(int index) {
    return index == peer::kGround ? ground_ : bodies_[static_cast<std::size_t>(index)];
  }

  void add(const peer::Body& from) {
    const auto body = make_shared<chrono::ChBody>();
    body->SetMass(from.mass);
    body->SetInertia(chrono::ChMatrix33<>(from.inertia));
    body->SetPos(vector_of(from.position));
    const Eigen::Quaterniond& q = from.orientation;
    body->SetRot(chrono::ChQuaterniond(q.w(), q.x(), q.y(), q.z()));
    body->SetPosDt(vector_of(from.velocity));
    body->SetAngVelParent(vector_of(from.angular_velocity));
    system_.AddBody(body);
    bodies_.push_back(body);
  }

  void add(const Joint& joint) {
    const auto link = [&]<class Link>(std::shared_ptr<Link> made) {
      made->Initialize(body(joint.child), body(joint.parent), joint_frame(joint));
      system_.AddLink(made);
    };
    switch (joint.kind) {
      case peer::JointKind::hinge:
        link(make_shared<chrono::ChLinkLockRevolute>());
        break;
      case peer::JointKind::slider:
        link(make_shared<chrono::ChLinkLockPrismatic>());
        break;
      case peer::JointKind::universal:
        // Its first body has the x axis.
        {
          const auto universal = make_shared<chrono::ChLinkUniversal>();
          universal->Initialize(body(joint.parent), body(joint.child), joint_frame(joint));
          system_.AddLink(universal);
        }
        break;
      case peer::JointKind::ball:
        link(make_shared<chrono::ChLinkLockSpherical>());
        break;
    }
    for (std::size_t a = 0; a < joint.forces.size(); ++a)
      if (joint.forces[a] != 0) push(joint, joint.forces[a] * joint.axes[a]);
  }

  /// On the first axis of a joint to the ground, which does not turn.
  void push(const Joint& joint, const peer::Vec3& force) {
    if (joint.parent != peer::kGround || joint.kind == peer::JointKind::universal)
      throw std::runtime_error("Chrono: torques along hinges and sliders of the ground alone");
    if (joint.kind == peer::JointKind::hinge)
      loads_->Add(make_shared<chrono::ChLoadBodyTorque>(body(joint.child), vector_of(force), false));
    else
      loads_->Add(make_shared<chrono::ChLoadBodyForce>(body(joint.child), vector_of(force), false,
                                                       chrono::ChVector3d(0, 0, 0), true));
  }

  void choose(const std::string& method) {
    using Type = chrono::ChTimestepper::Type;
    if (method == "euler_linearised") {
      system_.SetTimestepperType(Type::EULER_IMPLICIT_LINEARIZED);
    } else if (method == "euler_projected") {
      system_.SetTimestepperType(Type::EULER_IMPLICIT_PROJECTED);
    } else if (method == "hht") {
      system_.SetTimestepperType(Type::HHT);
      const auto stepper = std::dynamic_pointer_cast<chrono::ChTimestepperHHT>(system_.GetTimestepper());
      stepper->SetAlpha(0);
      stepper->SetMaxIters(50);
      stepper->SetAbsTolerances(1e-10);
      stepper->SetStepControl(false);
    } else {
      throw std::runtime_error("Chrono has methods euler_linearised, euler_projected and hht");
    }
  }

  double step_;
  chrono::ChSystemNSC system_;
  std::shared_ptr<chrono::ChBody> ground_ = make_shared<chrono::ChBody>();
  std::shared_ptr<chrono::ChLoadContainer> loads_ = make_shared<chrono::ChLoadContainer>();
  std::vector<std::shared_ptr<chrono::ChBody>> bodies_;
};

std::unique_ptr<peer::Mechanism> make(const Request& request) { return std::make_unique<Mechanism>(request); }

}  // namespace

int main() { return peer::serve({"Chrono", CHRONO_VERSION, {}, make}); }
