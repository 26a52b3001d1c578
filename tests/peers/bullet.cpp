// Bullet: a btMultiBody on a fixed base in joint coordinates, each loop closed by a btMultiBodyPoint2Point.
// Its one integrator is semi-implicit Euler, its solver iterative (setting `iterations`; Bullet's default:
// 10). A universal joint is two hinges with a massless link between them. Links carry colliders that collide
// with nothing: without them Bullet ignores the constraint and says nothing.
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <BulletDynamics/Featherstone/btMultiBodyPoint2Point.h>
#include <btBulletDynamicsCommon.h>

#include <stdexcept>

#include "peer.h"

namespace {

using peer::Joint;
using peer::Request;
using peer::Vec3;

btVector3 vector_of(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
Vec3 vector_of(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
btQuaternion quaternion_of(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }

/// Where a link's frame stands at the start, in the world: at its centre of mass.
struct Frame {
  Vec3 position = Vec3::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

class Mechanism final : public peer::Mechanism {
 public:
  explicit Mechanism(const Request& request)
      : step_(request.step),
        dispatcher_(&configuration_),
        world_(&dispatcher_, &broadphase_, &solver_, &configuration_),
        links_(request.bodies.size(), -1) {
    if (request.method != "semi_implicit_euler")
      throw std::runtime_error("Bullet has the method semi_implicit_euler");
    world_.setGravity(vector_of(request.gravity));
    int count = 0;
    for (const Joint& joint : request.joints) count += static_cast<int>(joint.axes.size());
    world_.getSolverInfo().m_numIterations = static_cast<int>(request.setting("iterations", 10));
    tree_ = std::make_unique<btMultiBody>(count, 0, btVector3(0, 0, 0), true, false);
    // Bullet damps and limits by default.
    tree_->setLinearDamping(0);
    tree_->setAngularDamping(0);
    tree_->setMaxCoordinateVelocity(1e9);
    for (const Joint& joint : request.joints)
      if (!joint.closes_loop) add(request, joint);
    tree_->finalizeMultiDof();
    add_colliders();
    world_.addMultiBody(tree_.get());
    for (const Joint& joint : request.joints)
      if (joint.closes_loop) close(request, joint);
  }
  Mechanism(const Mechanism&) = delete;
  Mechanism& operator=(const Mechanism&) = delete;
  ~Mechanism() override {
    for (const auto& constraint : constraints_) world_.removeMultiBodyConstraint(constraint.get());
    world_.removeMultiBody(tree_.get());
    for (const auto& collider : colliders_) world_.removeCollisionObject(collider.get());
  }

  void step() override {
    // The world forgets torques after each step.
    for (const auto& [link, force] : forces_) tree_->addJointTorque(link, force);
    world_.stepSimulation(step_, 0);
    ++count_;
  }

  double time() const override { return static_cast<double>(count_) * step_; }

  std::vector<peer::BodyState> state() override {
    const auto n = static_cast<std::size_t>(tree_->getNumLinks()) + 1;
    std::vector<btVector3> omega(n), velocity(n);
    tree_->compTreeLinkVelocities(omega.data(), velocity.data());
    std::vector<peer::BodyState> out;
    for (const int link : links_) {
      const btQuaternion q =
          btTransform(tree_->localFrameToWorld(link, btMatrix3x3::getIdentity())).getRotation();
      const auto at = static_cast<std::size_t>(link) + 1;
      out.push_back({vector_of(tree_->localPosToWorld(link, btVector3(0, 0, 0))),
                     Eigen::Quaterniond(q.w(), q.x(), q.y(), q.z()),
                     vector_of(tree_->localDirToWorld(link, velocity[at])),
                     vector_of(tree_->localDirToWorld(link, omega[at]))});
    }
    return out;
  }

  double kinetic_energy() override {
    const auto n = static_cast<std::size_t>(tree_->getNumLinks()) + 1;
    std::vector<btVector3> omega(n), velocity(n);
    tree_->compTreeLinkVelocities(omega.data(), velocity.data());
    double energy = 0;
    for (int i = 0; i < tree_->getNumLinks(); ++i) {
      const btVector3 &v = velocity[static_cast<std::size_t>(i) + 1],
                      &w = omega[static_cast<std::size_t>(i) + 1];
      energy += (tree_->getLinkMass(i) * v.dot(v) + (w * tree_->getLinkInertia(i)).dot(w)) / 2;
    }
    return energy;
  }

 private:
  /// The frame of a body, or of the base.
  Frame frame_of(const Request& request, int index) const {
    if (index == peer::kGround) return {};
    const peer::Body& body = request.bodies[static_cast<std::size_t>(index)];
    return {body.position, body.orientation};
  }
  int link_of(int index) const {
    return index == peer::kGround ? -1 : links_[static_cast<std::size_t>(index)];
  }

  void add(const Request& request, const Joint& joint) {
    const peer::Body& child = request.child(joint);
    const Eigen::Matrix3d& i = child.inertia;
    if (!i.isDiagonal())
      throw std::runtime_error("Bullet: the inertia of " + child.name + " is not diagonal");
    const std::vector<double> rates = request.rates(joint);
    int parent = link_of(joint.parent);
    Frame from = frame_of(request, joint.parent);
    for (std::size_t a = 0; a < joint.axes.size(); ++a) {
      const bool last = a + 1 == joint.axes.size();
      const Frame to = {last ? child.position : joint.anchor, child.orientation};
      const btQuaternion turn = quaternion_of(to.orientation.conjugate() * from.orientation);
      const btVector3 axis = vector_of(Vec3(to.orientation.conjugate() * joint.axes[a]));
      const btVector3 before = vector_of(Vec3(from.orientation.conjugate() * (joint.anchor - from.position)));
      const btVector3 after = vector_of(Vec3(to.orientation.conjugate() * (to.position - joint.anchor)));
      const double mass = last ? child.mass : 0;
      const btVector3 inertia = last ? vector_of(Vec3(i.diagonal())) : btVector3(0, 0, 0);
      if (joint.kind == peer::JointKind::slider)
        tree_->setupPrismatic(next_, mass, inertia, parent, turn, axis, before, after, true);
      else
        tree_->setupRevolute(next_, mass, inertia, parent, turn, axis, before, after, true);
      starts_.emplace_back(next_, rates[a]);
      if (joint.forces[a] != 0) forces_.emplace_back(next_, joint.forces[a]);
      parent = next_++;
      from = to;
    }
    links_[static_cast<std::size_t>(joint.child)] = parent;
  }

  void add_colliders() {
    for (const auto& [link, rate] : starts_) {
      tree_->setJointPos(link, 0);
      tree_->setJointVel(link, rate);
    }
    for (int link = 0; link < tree_->getNumLinks(); ++link) {
      auto& collider = colliders_.emplace_back(std::make_unique<btMultiBodyLinkCollider>(tree_.get(), link));
      collider->setCollisionShape(&shape_);
      world_.addCollisionObject(collider.get(), 0, 0);
      tree_->getLink(link).m_collider = collider.get();
    }
  }

  void close(const Request& request, const Joint& joint) {
    const auto inside = [&](int index) {
      const Frame frame = frame_of(request, index);
      return vector_of(Vec3(frame.orientation.conjugate() * (joint.anchor - frame.position)));
    };
    auto& constraint = constraints_.emplace_back(std::make_unique<btMultiBodyPoint2Point>(
        tree_.get(), link_of(joint.parent), tree_.get(), link_of(joint.child), inside(joint.parent),
        inside(joint.child)));
    constraint->setMaxAppliedImpulse(1e9);
    world_.addMultiBodyConstraint(constraint.get());
    constraint->finalizeMultiDof();
  }

  double step_;
  long count_ = 0;
  int next_ = 0;  ///< link
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  btMultiBodyConstraintSolver solver_;
  btMultiBodyDynamicsWorld world_;
  btSphereShape shape_{1e-3};
  std::unique_ptr<btMultiBody> tree_;
  std::vector<std::unique_ptr<btMultiBodyLinkCollider>> colliders_;
  std::vector<std::unique_ptr<btMultiBodyPoint2Point>> constraints_;
  std::vector<int> links_;                               ///< of each body of the request
  std::vector<std::pair<int, double>> starts_, forces_;  ///< by link
};

std::unique_ptr<peer::Mechanism> make(const Request& request) { return std::make_unique<Mechanism>(request); }

}  // namespace

int main() {
  return peer::serve({"Bullet",
                      std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100),
                      {"iterations"},
                      make});
}
