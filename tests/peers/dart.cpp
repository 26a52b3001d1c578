// DART: the tree as a skeleton in joint coordinates, each loop closed by a BallJointConstraint. Its one
// integrator is semi-implicit Euler; the setting `erp` is the share of a gap that a step closes (DART's
// default: 0.01).
#include <dart/dart.hpp>

#include <stdexcept>

#include "peer.h"

namespace {

using peer::Joint;
using peer::Request;

/// What all kinds of joints are told: where they sit.
template <class Properties>
Properties placed(const Request& request, const Joint& joint) {
  Eigen::Isometry3d frame = Eigen::Isometry3d::Identity();
  frame.translation() = joint.anchor;
  Properties properties;
  properties.mName = joint.name;
  properties.mT_ParentBodyToJoint = request.parent_pose(joint).inverse() * frame;
  properties.mT_ChildBodyToJoint = request.child(joint).pose().inverse() * frame;
  return properties;
}

class Mechanism final : public peer::Mechanism {
 public:
  explicit Mechanism(const Request& request)
      : world_(dart::simulation::World::create()),
        skeleton_(dart::dynamics::Skeleton::create()),
        bodies_(request.bodies.size()) {
    if (request.method != "semi_implicit_euler")
      throw std::runtime_error("DART has the method semi_implicit_euler");
    world_->setGravity(request.gravity);
    world_->setTimeStep(request.step);
    dart::constraint::DynamicJointConstraint::setErrorReductionParameter(request.setting("erp", 0.01));
    for (const Joint& joint : request.joints)
      if (!joint.closes_loop) add(request, joint);
    world_->addSkeleton(skeleton_);
    for (const Joint& joint : request.joints)
      if (joint.closes_loop)
        world_->getConstraintSolver()->addConstraint(std::make_shared<dart::constraint::BallJointConstraint>(
            body(joint.parent), body(joint.child), joint.anchor));
    forces_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(skeleton_->getNumDofs()));
    for (const Joint& joint : request.joints) {
      const std::vector<double> rates = request.rates(joint);
      for (std::size_t a = 0; a < rates.size(); ++a) {
        dart::dynamics::DegreeOfFreedom* dof = body(joint.child)->getParentJoint()->getDof(a);
        dof->setVelocity(rates[a]);
        forces_[static_cast<Eigen::Index>(dof->getIndexInSkeleton())] = joint.forces[a];
      }
    }
    forced_ = forces_.squaredNorm() > 0;
  }

  void step() override {
    // The world forgets forces after each step.
    if (forced_) skeleton_->setForces(forces_);
    world_->step();
  }

  double time() const override { return world_->getTime(); }

  std::vector<peer::BodyState> state() override {
    std::vector<peer::BodyState> out;
    for (const dart::dynamics::BodyNode* node : bodies_)
      out.push_back({node->getWorldTransform().translation(),
                     Eigen::Quaterniond(node->getWorldTransform().linear()), node->getLinearVelocity(),
                     node->getAngularVelocity()});
    return out;
  }

  double kinetic_energy() override { return skeleton_->computeKineticEnergy(); }

 private:
  dart::dynamics::BodyNode* body(int index) {
    return index == peer::kGround ? nullptr : bodies_[static_cast<std::size_t>(index)];
  }

  void add(const Request& request, const Joint& joint) {
    const peer::Body& child = request.child(joint);
    const Eigen::Matrix3d& i = child.inertia;
    dart::dynamics::BodyNode::Properties properties;
    properties.mName = child.name;
    properties.mInertia = dart::dynamics::Inertia(child.mass, Eigen::Vector3d::Zero(), i);
    // The joint frame of placed() stands as the world at the start, and so do its axes.
    dart::dynamics::BodyNode*& node = bodies_[static_cast<std::size_t>(joint.child)];
    dart::dynamics::BodyNode* parent = body(joint.parent);
    switch (joint.kind) {
      case peer::JointKind::hinge: {
        auto p = placed<dart::dynamics::RevoluteJoint::Properties>(request, joint);
        p.mAxis = joint.axes[0];
        node = skeleton_->createJointAndBodyNodePair<dart::dynamics::RevoluteJoint>(parent, p, properties)
                   .second;
        break;
      }
      case peer::JointKind::slider: {
        auto p = placed<dart::dynamics::PrismaticJoint::Properties>(request, joint);
        p.mAxis = joint.axes[0];
        node = skeleton_->createJointAndBodyNodePair<dart::dynamics::PrismaticJoint>(parent, p, properties)
                   .second;
        break;
      }
      case peer::JointKind::universal: {
        auto p = placed<dart::dynamics::UniversalJoint::Properties>(request, joint);
        p.mAxis[0] = joint.axes[0];
        p.mAxis[1] = joint.axes[1];
        node = skeleton_->createJointAndBodyNodePair<dart::dynamics::UniversalJoint>(parent, p, properties)
                   .second;
        break;
      }
      case peer::JointKind::ball:
        break;
    }
  }

  dart::simulation::WorldPtr world_;
  dart::dynamics::SkeletonPtr skeleton_;
  std::vector<dart::dynamics::BodyNode*> bodies_;  ///< of the skeleton, which owns them
  Eigen::VectorXd forces_;
  bool forced_ = false;
};

std::unique_ptr<peer::Mechanism> make(const Request& request) { return std::make_unique<Mechanism>(request); }

}  // namespace

int main() { return peer::serve({"DART", DART_VERSION, {"erp"}, make}); }
