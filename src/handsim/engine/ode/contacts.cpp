#include "handsim/engine/ode/contacts.h"

#include <algorithm>
#include <cmath>

#include "handsim/engine/spring.h"

namespace handsim::engine::ode {

namespace {

std::vector<dBodyID> ids_of(const std::vector<OdeBody>& bodies) {
  std::vector<dBodyID> out;
  for (const OdeBody& body : bodies) out.push_back(body.id);
  return out;
}

/// Velocity of a body's point.
Vec3 velocity(const model::BodyState& body, const Vec3& at) { return body.v + body.w.cross(at - body.p); }

constexpr double kLeastMoment = 1e-9;  ///< Moment per normal force that stands for none [m].
/// Normal force that stands for none where friction's limits are set [N].
constexpr double kLeastForce = 1e-9;
/// Least limit of the second friction row, as a share of the first: together they exceed the cone by 8e-4.
constexpr double kLeastAcross = 0.04;
/// Distance of the two points of a row without limits, along the row [m]: their place between has no effect.
constexpr double kRowLength = 0.1;
/// Share of its limit below which friction is taken to stick in the next solution.
/// Above it slides, if it slipped.
constexpr double kSticking = 0.99;
/// Share of the mass by which slip turns the direction of friction. With 0.1 hands of 17 points overshoot.
constexpr double kDirectionShare = 0.03;

}  // namespace

Contacts::Contacts(OdeIds& ids, const model::Model& model, const Settings& settings,
                   const std::vector<OdeBody>& bodies)
    : model_(model),
      bodies_(bodies),
      world_(ids.world.get()),
      collider_(model, settings.effects, settings.ode().speculative, ids_of(bodies)),
      crossed_(model),
      memory_(model, bodies),
      friction_(settings.effects.has(model::Effect::friction)),
      iterative_(settings.ode().method == OdeMethod::quick_step),
      with_forces_(settings.contact_forces),
      measures_forces_(with_forces_ || (friction_ && !iterative_)),
      erp_(settings.erp()),
      step_(settings.step) {
  set_gravity(settings.effects.has(model::Effect::gravity) ? model.gravity : Vec3(Vec3::Zero()));
  if (PadMemory::needed(model)) pads_.emplace();
  ids.contact_joints.reset(dJointGroupCreate(0));
  joints_ = ids.contact_joints.get();
  dWorldSetContactSurfaceLayer(world_, kSurfaceLayer);
}

void Contacts::set_gravity(const Vec3& gravity) { fall_ = gravity * step_; }

void Contacts::reset(const model::State& state) {
  memory_.set({});
  limits_.set({});
  if (pads_) pads_->set(state.pads);
}

void Contacts::recall(const model::State& state) {
  crossed_.find(collider_);
  if (pads_) pads_->recall(collider_, step_);
  if (!friction_) return;
  if (iterative_)
    memory_.recall(collider_, state);
  else
    limits_.recall(collider_);
}

void Contacts::join(const model::State& state, bool rigid_limits) {
  contact_joints_.clear();
  const std::vector<Contact>& found = collider_.contacts();
  applied_.assign(found.size(), Vec3::Zero());
  for (std::size_t k = 0; k < collider_.touches().size(); ++k) {
    const Touch& touch = collider_.touches()[k];
    Known known;
    if (pads_) known.step = pads_->of(k);
    if (friction_ && iterative_) known.patch = &memory_.patches()[k];
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
      known.share = collider_.shares()[i];
      known.spinning = collider_.spinning(touch, i);
      known.pad = touch.surface.compliance.has_value();
      known.force = nullptr;
      // Friction of their own normal forces would wedge bodies that lie across each other.
      const bool limited = known.pad || (rigid_limits && crossed_.inverse_mass(found[i]) == 0);
      if (friction_ && !iterative_ && limited && limits_.force(i)) known.force = &*limits_.force(i);
      known.guess = guesses_[i].guess;
      add_contact(i, touch, known, state);
    }
  }
  if (!measures_forces_) return;
  feedback_.resize(contact_joints_.size());
  for (std::size_t k = 0; k < feedback_.size(); ++k) dJointSetFeedback(contact_joints_[k].id, &feedback_[k]);
}

void Contacts::read_forces() {
  if (!measures_forces_) return;
  std::vector<Contact>& found = collider_.contacts();
  forces_ = applied_;
  for (std::size_t k = 0; k < feedback_.size(); ++k) {
    const dReal* f = feedback_[k].f1;
    const std::size_t i = contact_joints_[k].contact;
    forces_[i] += side(found[i]) * Vec3(f[0], f[1], f[2]);
  }
  if (!with_forces_) return;
  for (std::size_t i = 0; i < found.size(); ++i) found[i].force = forces_[i];
}

void Contacts::update_memory(const model::State& before) {
  if (friction_ && iterative_) memory_.update(before, step_);
  if (pads_)
    pads_->store(collider_, step_,
                 [&](std::size_t i) { return depth_after(collider_.contacts()[i], before); });
}

void Contacts::guess(const model::State& state) {
  guesses_.assign(collider_.contacts().size(), {});
  if (!friction_ || iterative_) return;
  for (const Touch& touch : collider_.touches())
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
      const model::Material& between = touch.surface;
      const Contact& contact = collider_.contacts()[i];
      if (!between.compliance || !limits_.force(i) || between.restitution > 0 ||
          between.rolling_friction > 0 || between.spinning(between.friction, contact.depth) > 0)
        continue;
      const Vec3& force = *limits_.force(i);
      const double normal = contact.normal.dot(force);
      if (normal <= kLeastForce) continue;
      const Vec3 friction = force - normal * contact.normal;
      const double limit = between.friction * normal;
      if (friction.norm() < kSticking * limit) {
        guesses_[i].guess = Guess::sticks;
        continue;
      }
      const Vec3 slip = given_way(i,
                                  velocity(state.bodies[body_index(contact.shape_a)], contact.position) -
                                      velocity(state.bodies[body_index(contact.shape_b)], contact.position),
                                  force);
      const double speed = slip.norm();
      if (speed > kStill && slip.dot(friction) < 0)
        guesses_[i] = {Guess::slides, slip / speed, speed, limit};
      else
        guesses_[i].guess = Guess::sticks;
    }
}

/// Tangential velocity of a's surface against b's beyond what rows of the world's CFM give way by.
Vec3 Contacts::given_way(std::size_t index, const Vec3& velocity, const Vec3& force) const {
  const Vec3 slip = velocity + dWorldGetCFM(world_) * force, n = collider_.contacts()[index].normal;
  return slip - slip.dot(n) * n;
}

bool Contacts::refutes(const model::State& before, bool mend) {
  if (!friction_) return false;
  for (std::size_t i = 0; i < guesses_.size(); ++i)
    guesses_[i].slip = given_way(i, slip_after(collider_.contacts()[i], before), forces_[i]);
  return limits_.refute(collider_, forces_, guesses_, mend);
}

/// How fast the surfaces of a contact part along its normal.
double Contacts::parting_rate(const Contact& contact, const model::State& state) const {
  return contact.normal.dot(velocity(state.bodies[body_index(contact.shape_a)], contact.position) -
                            velocity(state.bodies[body_index(contact.shape_b)], contact.position));
}

/// Depth in a pad after a step, by the rates there.
double Contacts::depth_after(const Contact& contact, const model::State& before) const {
  return depth_in_pad(contact) - step_ * contact.normal.dot(slip_after(contact, before));
}

/// Velocity of a's surface against b's after a step, at the place of a contact before it.
Vec3 Contacts::slip_after(const Contact& contact, const model::State& before) const {
  const auto moves = [&](int shape) -> Vec3 {
    const std::size_t body = body_index(shape);
    const OdeBody& moved = bodies_[body];
    if (moved.id == nullptr) return velocity(before.bodies[body], contact.position);
    const Vec3 v(moved.v[0], moved.v[1], moved.v[2]), w(moved.w[0], moved.w[1], moved.w[2]);
    return v + w.cross(contact.position - before.bodies[body].p);
  };
  return moves(contact.shape_a) - moves(contact.shape_b);
}

void Contacts::release() { dJointGroupEmpty(joints_); }

void Contacts::save(ArchiveWriter& out) const {
  collider_.save(out);
  memory_.save(out);
  limits_.save(out);
}

void Contacts::restore(ArchiveReader& in) {
  collider_.restore(in);
  memory_.restore(in);
  limits_.restore(in);
}

dBodyID Contacts::body_of(int shape) const { return bodies_[body_index(shape)].id; }

double Contacts::side(const Contact& contact) const { return body_of(contact.shape_a) == nullptr ? -1 : 1; }

/// A row of ODE's obeys v+ + CFM lambda = ERP / h depth: the pad's spring and damper at the step's end.
void Contacts::set_compliance(dSurfaceParameters& surface, const model::Compliance& pad, double share) const {
  const SoftRow row = soft_row(share * pad.stiffness, share * pad.damping, step_);
  surface.mode |= dContactSoftERP | dContactSoftCFM;
  surface.soft_erp = row.erp;
  surface.soft_cfm = row.cfm;
}

/// The tangent of a pad's law at the depth that the step would end at with the rates of its start, so that
/// the row's force is the law's where these last. @param rate at which the surfaces part
void Contacts::set_law(dSurfaceParameters& surface, const Contact& contact, const model::Compliance& pad,
                       const Known& known, double rate) const {
  const double depth = depth_in_pad(contact), rise = pad.rise();
  const double deeper = std::clamp(-step_ * rate, -rise, rise);
  const model::Elastic there = pad.elastic(depth + deeper);
  const double force = known.step.gain * (there.force - there.slope * deeper) + known.step.offset;
  surface.mode |= dContactSoftERP | dContactSoftCFM | dContactMotionN;
  surface.soft_erp = 0;
  surface.soft_cfm = 1 / (known.share * (step_ * known.step.gain * there.slope + pad.damping));
  surface.motionN = known.share * force * surface.soft_cfm;
}

/// For a contact about to happen: rigid surfaces approach by the gap between them at most, pads as far as
/// their spring and damper allow at the step's end. A contact that is to bounce does so in this step.
void Contacts::limit_approach(dSurfaceParameters& surface, const Contact& contact,
                              const model::Material& between, double share, const model::State& state) const {
  if (between.restitution > 0 && -parting_rate(contact, state) > between.restitution_speed) return;
  surface.mode &= ~dContactBounce;
  if (between.compliance && between.compliance->law) return;
  const double closes =
      between.compliance
          ? soft_row(share * between.compliance->stiffness, share * between.compliance->damping, step_).erp
          : 1;
  surface.mode |= dContactMotionN;
  surface.motionN = closes * contact.depth / step_;
}

void Contacts::add_contact(std::size_t index, const Touch& touch, const Known& known,
                           const model::State& state) {
  const Contact& contact = collider_.contacts()[index];
  const model::Material& between = touch.surface;
  dContact joint{};
  for (int i = 0; i < 3; ++i) {
    joint.geom.pos[i] = contact.position[i];
    joint.geom.normal[i] = contact.normal[i];
  }
  joint.geom.depth = std::max(contact.depth, 0.0);
  dSurfaceParameters& surface = joint.surface;
  if (between.restitution > 0) {
    surface.mode |= dContactBounce;
    surface.bounce = between.restitution;
    surface.bounce_vel = between.restitution_speed;
  }
  if (contact.depth < 0) limit_approach(surface, contact, between, known.share, state);
  const double inside = contact.depth - kSurfaceLayer;
  if (between.compliance && between.compliance->law) {
    set_law(surface, contact, *between.compliance, known, parting_rate(contact, state));
  } else if (between.compliance) {
    set_compliance(surface, *between.compliance, known.share);
  } else {
    if (erp_ * inside > kMaxCorrectingSpeed * step_) {
      surface.mode |= dContactSoftERP;
      surface.soft_erp = kMaxCorrectingSpeed * step_ / inside;
    }
    if (const double inverse_mass = crossed_.inverse_mass(contact); inverse_mass > 0) {
      surface.mode |= dContactSoftCFM;
      surface.soft_cfm = inverse_mass * step_;
    }
  }
  // A pad with spinning but no rolling friction gets a motor: its row takes a speed or a limit.
  const bool motor = (known.patch != nullptr || known.force != nullptr) && between.compliance &&
                     between.rolling_friction == 0 && known.spinning > 0;
  if (friction_) set_friction(joint, contact, between, known, motor);
  if (surface.mu > 0 && known.guess == Guess::limited) set_friction_direction(joint, contact, known, state);
  if (known.guess != Guess::limited) return join_guessed(joint, index);
  const dJointID id = dJointCreateContact(world_, joints_, &joint);
  dJointAttach(id, body_of(contact.shape_a), body_of(contact.shape_b));
  contact_joints_.push_back({id, index});
  if (motor) add_spin_row(contact, touch, known);
}

/// The contact's rows without limits, each a joint; friction at its limit as a force.
void Contacts::join_guessed(const dContact& joint, std::size_t index) {
  const Contact& contact = collider_.contacts()[index];
  const dSurfaceParameters& surface = joint.surface;
  const double inside = std::max(joint.geom.depth - kSurfaceLayer, 0.0);
  add_row(index, contact.normal, surface.soft_erp / step_ * inside + surface.motionN, surface.soft_cfm);
  const Guessed& guessed = guesses_[index];
  const Vec3 n = contact.normal;
  const double cfm = dWorldGetCFM(world_);
  if (guessed.guess == Guess::sticks) {
    add_row(index, n.unitOrthogonal(), 0, cfm);
    return add_row(index, n.cross(n.unitOrthogonal()), 0, cfm);
  }
  // Friction turns with the slip: by limit / speed for each m/s across it.
  add_row(index, n.cross(guessed.along), 0, cfm + guessed.speed / std::max(guessed.limit, kLeastForce));
  applied_[index] = -guessed.limit * guessed.along;
  const auto push = [&](int shape, const Vec3& f) {
    const Vec3& at = contact.position;
    if (const dBodyID id = body_of(shape))
      dBodyAddForceAtPos(id, f.x(), f.y(), f.z(), at.x(), at.y(), at.z());
  };
  push(contact.shape_a, applied_[index]);
  push(contact.shape_b, -applied_[index]);
}

/// A row without limits, v+ + CFM lambda = speed with v of a's surface against b's along the axis: ODE's
/// joint that holds two points at a distance, points that lie on the axis. What it lacks of its distance is
/// made good in one step.
void Contacts::add_row(std::size_t index, const Vec3& axis, double speed, double cfm) {
  const Contact& contact = collider_.contacts()[index];
  const double turned = side(contact);
  const dBodyID a = body_of(contact.shape_a), b = body_of(contact.shape_b);
  const dJointID id = dJointCreateDBall(world_, joints_);
  dJointAttach(id, turned < 0 ? b : a, turned < 0 ? nullptr : b);
  const Vec3 half = turned * kRowLength / 2 * axis;
  const Vec3 first = contact.position + half, second = contact.position - half;
  dJointSetDBallAnchor1(id, first.x(), first.y(), first.z());
  dJointSetDBallAnchor2(id, second.x(), second.y(), second.z());
  dJointSetDBallDistance(id, kRowLength + step_ * speed);
  dJointSetDBallParam(id, dParamERP, 1);
  dJointSetDBallParam(id, dParamCFM, cfm);
  contact_joints_.push_back({id, index});
}

/// Limits of friction's rows: shares of the normal force that ODE finds, or forces where that is known.
void Contacts::set_friction(dContact& joint, const Contact& contact, const model::Material& between,
                            const Known& known, bool spins_by_motor) {
  dSurfaceParameters& surface = joint.surface;
  double normal = 1;
  if (known.force == nullptr)
    surface.mode |= dContactApprox1;
  else
    normal = std::max(contact.normal.dot(*known.force), kLeastForce);
  surface.mode |= dContactAxisDep;
  // Rows with limits near 0 of rigid points that carry nothing make the solver fail.
  if (known.force != nullptr && !known.pad && normal <= kLeastForce) normal = 0;
  surface.mu = surface.mu2 = between.friction * normal;
  if (normal == 0) return;
  if (spins_by_motor || (between.rolling_friction == 0 && known.spinning == 0)) return;
  surface.mode |= dContactRolling;
  // ODE counts a row for each of the three, at 0 too, but then leaves it blank.
  surface.rho = surface.rho2 = std::max(between.rolling_friction, kLeastMoment) * normal;
  surface.rhoN = std::max(known.spinning, kLeastMoment) * normal;
}

/// The moment about the normal, up to the lever times the normal force: the known one, or the pad spring's.
void Contacts::add_spin_row(const Contact& contact, const Touch& touch, const Known& known) {
  const model::Compliance& pad = *touch.surface.compliance;
  const double inside = std::max(contact.depth - kSurfaceLayer, 0.0);
  const double force = known.force != nullptr ? std::max(contact.normal.dot(*known.force), kLeastForce)
                       : pad.law              ? known.share * pad.elastic(inside).force
                                              : known.share * pad.stiffness * inside;
  const dJointID motor = dJointCreateAMotor(world_, joints_);
  dJointAttach(motor, body_of(contact.shape_a), body_of(contact.shape_b));
  dJointSetAMotorNumAxes(motor, 1);
  dJointSetAMotorAxis(motor, 0, 0, contact.normal.x(), contact.normal.y(), contact.normal.z());
  const double turn = known.patch != nullptr ? known.patch->turn : 0;
  dJointSetAMotorParam(motor, dParamVel, -side(contact) * kPullBack / step_ * turn);
  dJointSetAMotorParam(motor, dParamFMax, known.spinning * force);
}

/// Lays the first friction row along the change of velocity that it has to bring about: from what the
/// surfaces would slide at to standing still or to taking back what they have crept. The second then has
/// nothing to do. Where the last force is known, it has held what would slide without it: as in the augmented
/// Lagrangian of Alart and Curnier (1991), it is the impulse's direction less the shared mass times the slip.
void Contacts::set_friction_direction(dContact& joint, const Contact& contact, const Known& known,
                                      const model::State& state) const {
  const Patch* patch = known.patch;
  const Vec3 back =
      patch != nullptr ? Vec3(-kPullBack / step_ * patch->shift_at(contact.position)) : Vec3(Vec3::Zero());
  Vec3 change = sliding(contact, state) - back, friction = Vec3::Zero();
  // Rigid surfaces that slide do so along the row to rounding.
  const bool by_force = known.force != nullptr && known.pad;
  if (by_force) {
    friction = *known.force - contact.normal.dot(*known.force) * contact.normal;
    change -= step_ / shared_mass(contact, state) * friction;
  }
  const double speed = change.norm();
  if (speed <= kStill) return;
  dSurfaceParameters& surface = joint.surface;
  if (by_force) {
    // The corner of the two limits lies on the cone's circle.
    const double along = std::min(std::abs(friction.dot(change)) / (speed * surface.mu), 1.0);
    surface.mu2 = surface.mu * std::max(std::sqrt(1 - along * along), kLeastAcross);
  }
  surface.mode |= dContactFDir1;
  for (int i = 0; i < 3; ++i) joint.fdir1[i] = change[i] / speed;
  if (patch == nullptr) return;
  surface.mode |= dContactMotion1 | dContactMotion2;
  surface.motion1 = side(contact) * back.dot(change) / speed;
  surface.motion2 = back.dot(contact.normal.cross(change)) / speed;
}

/// About the mass that a force at the contact has to move, joints and other contacts left aside [kg]. They
/// add to it: too large a mass would make the direction overshoot from step to step.
double Contacts::shared_mass(const Contact& contact, const model::State& state) const {
  double mobility = 0;
  for (const int shape : {contact.shape_a, contact.shape_b}) {
    const std::size_t index = body_index(shape);
    const model::Body& body = model_.bodies[index];
    if (body.kinematic) continue;
    mobility +=
        1 / body.mass + (contact.position - state.bodies[index].p).squaredNorm() * 3 / body.inertia.trace();
  }
  return kDirectionShare / mobility;
}

/// Tangential velocity of a against b after this step without the contact: at rest the direction of gravity.
Vec3 Contacts::sliding(const Contact& contact, const model::State& state) const {
  const auto free = [&](int shape) -> Vec3 {
    const std::size_t body = body_index(shape);
    const Vec3 v = velocity(state.bodies[body], contact.position);
    return model_.bodies[body].kinematic ? v : Vec3(v + fall_);
  };
  const Vec3 v = free(contact.shape_a) - free(contact.shape_b);
  return v - v.dot(contact.normal) * contact.normal;
}

std::size_t Contacts::body_index(int shape) const { return as_index(model_.shapes[as_index(shape)].body); }

}  // namespace handsim::engine::ode
