#include "handsim/engine/ode/joints.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "handsim/engine/spring.h"

namespace handsim::engine::ode {

namespace {

/// A stop is looked out for by this many steps of the present rate, for what the step adds to it.
constexpr double kCatchSteps = 2;
/// Nearer to its stop than this a coordinate counts as on it, whatever its rate [rad] or [m].
constexpr double kOnStop = 1e-6;
/// Least damping of a row of tissue or tendons [N m s/rad]: too small to change the motion.
constexpr double kLeastDamping = 1e-15;

std::unique_ptr<dJointFeedback> with_feedback(dJointID motor) {
  auto out = std::make_unique<dJointFeedback>();
  dJointSetFeedback(motor, out.get());
  return out;
}

/// By dof, whether a tendon in effect crosses it.
std::vector<bool> crossed_by_tendons(const model::Model& model, const model::Effects& effects) {
  std::vector<bool> out(as_index(model.dof_count()), false);
  const auto add = [&](const model::TendonPath& path) {
    for (const model::MomentArm& arm : path.arms) out[as_index(arm.dof)] = true;
  };
  if (effects.has(model::Effect::muscles))
    for (const model::Muscle& muscle : model.muscles) add(muscle.path);
  if (effects.has(model::Effect::tendon_coupling))
    for (const model::Band& band : model.bands) add(band.path);
  return out;
}

}  // namespace

Joints::Joints(dWorldID world, const model::Model& model, const Settings& settings,
               const std::vector<OdeBody>& bodies, const model::State& start)
    : sensors_(model),
      servos_(settings.step),
      step_(settings.step),
      erp_(settings.erp()),
      dragged_(crossed_by_tendons(model, settings.effects)),
      drag_(dragged_.size(), 0.0) {
  std::vector<std::size_t> copies_used(bodies.size(), 0);
  for (const model::Joint& joint : model.joints) {
    links_.push_back(make_link(world, joint, bodies, copies_used));
    Link& link = links_.back();
    if (link.id == nullptr) continue;
    if (settings.effects.has(model::Effect::joint_stops)) add_stops(link, settings);
    add_tissue(world, link, settings.effects.has(model::Effect::passive_tissue));
    if (settings.effects.has(model::Effect::actuation)) add_servo(world, link);
    place(link, start);
    watch(links_.size() - 1, settings);
  }
}

Joints::Link Joints::make_link(dWorldID world, const model::Joint& joint, const std::vector<OdeBody>& bodies,
                               std::vector<std::size_t>& copies_used) const {
  const auto parent_index = as_index(joint.parent);
  Link link;
  link.joint = &joint;
  link.child = bodies[as_index(joint.child)];
  link.parent = bodies[parent_index];
  // The first joint of a driven body hangs on the body, every other on a copy of its own.
  if (link.parent.driven && copies_used[parent_index]++ > 0)
    link.parent = handle(bodies[parent_index].copies[copies_used[parent_index] - 2]);
  const auto moves = [](const OdeBody& body) { return body.id != nullptr && !dBodyIsKinematic(body.id); };
  if (!moves(link.child) && !moves(link.parent)) return link;
  link.id = create_joint(world, joint.kind);
  dJointAttach(link.id, link.child.id, link.parent.id);
  return link;
}

void Joints::place(const Link& link, const model::State& state) const {
  const model::Joint& joint = *link.joint;
  // A parent with an ODE body may stand anywhere: at the origin its anchors do not depend on the scene.
  model::BodyState parent;
  if (link.parent.id == nullptr) parent = state.bodies[as_index(joint.parent)];
  const Pose x_WF = parent.pose() * joint.parent_frame;
  const Pose x_WC = x_WF * joint.child_frame.inverse();
  model::BodyState child;
  child.p = x_WC.p;
  child.q = x_WC.q;
  write_state(link.parent, parent);
  write_state(link.child, child);
  set_geometry(link.id, joint, x_WF);
  if (link.motor != nullptr)
    set_motor_axes(link.motor, joint, link.motor_axes, link.parent.id != nullptr, x_WF);
  for (const ServoMotor& servo : link.servos)
    set_motor_axes(servo.id, joint, servo.axes, link.parent.id != nullptr, x_WF);
}

void Joints::reanchor(const model::State& state) {
  for (const Link& link : links_)
    if (link.id != nullptr && link.parent.id == nullptr) place(link, state);
}

model::Stop Joints::widened(const model::Joint& joint, std::size_t index, bool note) {
  const model::JointAxis& axis = joint.axes[index];
  const double margin = joint.slides(index) ? kSliderStopMargin : kStopMargin;
  const auto moved = [&](const char* end, double value, double outward) {
    if (std::abs(value) >= margin) return value;
    if (note)
      notes_.push_back(
          fmt::format("{}.{}: {} stop {:g} {unit} moved to {:g} {unit}, clear of a start at zero", joint.name,
                      axis.name, end, value, value + outward, fmt::arg("unit", joint.unit(index))));
    return value + outward;
  };
  model::Stop stop = *axis.stop;
  stop.low = moved("low", stop.low, -margin);
  stop.high = moved("high", stop.high, margin);
  return stop;
}

void Joints::add_stops(const Link& link, const Settings& settings) {
  const model::Joint& joint = *link.joint;
  for (std::size_t i = 0; i < joint.axes.size(); ++i) {
    if (!joint.axes[i].stop) continue;
    const model::Stop stop = widened(joint, i, true);
    const int group = kParamGroup * ode_axis(joint.kind, i);
    set_stop(link, i, stop.low, stop.high, settings.erp(), stop.restitution);
    set_parameter(link.id, joint.kind, dParamStopCFM + group, settings.ode().cfm);
  }
}

/// A row for each axis with tissue in effect or with tendons.
void Joints::add_tissue(dWorldID world, Link& link, bool with_tissue) {
  const model::Joint& joint = *link.joint;
  for (std::size_t i = 0; i < joint.axes.size(); ++i) {
    const std::optional<model::Tissue>& own = joint.axes[i].tissue;
    const bool tissue = with_tissue && own && (own->stiffness > 0 || own->damping > 0);
    has_tissue_ = has_tissue_ || tissue;
    if (!tissue && !dragged_[as_index(joint.first_dof) + i]) continue;
    link.motor_axes.push_back(i);
    link.tissue.push_back(tissue ? *own : model::Tissue{});
  }
  if (link.motor_axes.empty()) return;
  link.motor = create_motor(world, joint, link.motor_axes, link.child.id, link.parent.id);
  link.by_motor = with_feedback(link.motor);
  set_tissue(link);
}

void Joints::set_tissue(const Link& link) const {
  const model::Joint& joint = *link.joint;
  const int axes = static_cast<int>(link.motor_axes.size());
  for (int i = 0; i < axes; ++i) {
    const model::Tissue& tissue = link.tissue[as_index(i)];
    const std::size_t dof = as_index(joint.first_dof) + link.motor_axes[as_index(i)];
    // A row without stiffness and damping would not be one.
    const auto row = soft_row(tissue.stiffness, std::max(tissue.damping + drag_[dof], kLeastDamping), step_);
    const int group = kParamGroup * i;
    if (joint.slides(0)) {
      // An LMotor has no position: it gets the speed that the same row would ask for.
      dJointSetLMotorParam(link.motor, dParamFMax + group, dInfinity);
      dJointSetLMotorParam(link.motor, dParamCFM + group, row.cfm);
      continue;
    }
    dJointSetAMotorParam(link.motor, dParamLoStop + group, tissue.rest);
    dJointSetAMotorParam(link.motor, dParamHiStop + group, tissue.rest);
    dJointSetAMotorParam(link.motor, dParamStopERP + group, row.erp);
    dJointSetAMotorParam(link.motor, dParamStopCFM + group, row.cfm);
  }
}

double Joints::slider_pull(const Link& link) const {
  if (link.motor == nullptr || !link.joint->slides(0)) return 0;
  const model::Tissue& tissue = *link.joint->axes[0].tissue;
  return soft_row(tissue.stiffness, tissue.damping, step_).erp / step_;
}

void Joints::set_drag(std::span<const double> damping) {
  drag_.assign(damping.begin(), damping.end());
  for (const Link& link : links_)
    if (link.motor != nullptr) set_tissue(link);
}

void Joints::add_servo(dWorldID world, Link& link) {
  const model::Joint& joint = *link.joint;
  for (std::size_t i = 0; i < joint.axes.size(); ++i) {
    if (i == 0 || joint.slides(i) != joint.slides(i - 1)) link.servos.emplace_back();
    link.servos.back().axes.push_back(i);
  }
  for (ServoMotor& servo : link.servos) {
    servo.id = create_motor(world, joint, servo.axes, link.child.id, link.parent.id);
    servo.feedback = with_feedback(servo.id);
    servos_.add(servo.id, joint, servo.axes);
  }
}

void Joints::watch(std::size_t link_index, const Settings& settings) {
  const Link& link = links_[link_index];
  const model::Joint& joint = *link.joint;
  const bool with_stops = settings.effects.has(model::Effect::joint_stops);
  Watch watched{link_index, {}};
  watched.pull = slider_pull(link);
  for (std::size_t i = 0; i < joint.axes.size(); ++i)
    if (with_stops && joint.axes[i].stop) {
      const model::Stop stop = widened(joint, i, false);
      watched.stops[i].emplace(stop.low, stop.high);
    }
  if (link.motor != nullptr || watched.stops[0] || watched.stops[1]) watches_.push_back(watched);
}

int Joints::prepare(const model::State& state) {
  int reached = 0;
  for (Watch& watched : watches_) {
    reached += prepare_stops(watched, state);
    if (links_[watched.link].motor != nullptr) prepare_tissue(watched, state);
  }
  return reached;
}

void Joints::prepare_tissue(const Watch& watched, const model::State& state) const {
  const Link& link = links_[watched.link];
  const double* q = state.q.data() + link.joint->first_dof;
  if (link.joint->slides(0)) {
    dJointSetLMotorParam(link.motor, dParamVel, -watched.pull * (q[0] - link.joint->axes[0].tissue->rest));
    return;
  }
  for (std::size_t i = 0; i < link.motor_axes.size(); ++i) {
    dJointSetAMotorAngle(link.motor, static_cast<int>(i), q[link.motor_axes[i]]);
    const std::size_t dof = as_index(link.joint->first_dof) + link.motor_axes[i];
    if (!dragged_[dof]) continue;
    // Drag holds the rate that the step starts with: as the row's target, which an iterative solver starts
    // near. With ERP 1 the row asks for v+ = (rest - q) / h.
    const model::Tissue& tissue = link.tissue[i];
    const double pull = tissue.stiffness * (q[link.motor_axes[i]] - tissue.rest) - drag_[dof] * state.u[dof];
    const double sum = step_ * tissue.stiffness + std::max(tissue.damping + drag_[dof], kLeastDamping);
    const double target = q[link.motor_axes[i]] - step_ * pull / sum;
    const int group = kParamGroup * static_cast<int>(i);
    dJointSetAMotorParam(link.motor, dParamLoStop + group, target);
    dJointSetAMotorParam(link.motor, dParamHiStop + group, target);
    dJointSetAMotorParam(link.motor, dParamStopERP + group, 1);
  }
}

int Joints::prepare_stops(Watch& watched, const model::State& state) const {
  const Link& link = links_[watched.link];
  int reached = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    if (!watched.stops[i]) continue;
    const std::size_t dof = as_index(link.joint->first_dof) + i;
    const Approach approach{i, watched.stops[i]->low(), watched.stops[i]->high(), state.q[dof], state.u[dof]};
    const bool on_stop = link.joint->slides(i) ? approach.q <= approach.low || approach.q >= approach.high
                                               : watched.stops[i]->reached(sensors_.directions()[dof]);
    if (on_stop) {
      ++reached;
      let_go(link, approach, watched.caught[i]);
    } else {
      reached += catch_approach(link, approach, watched.caught[i]) ? 1 : 0;
    }
  }
  return reached;
}

// ODE puts a stop's row into a step once the stop is passed, and pushes back by ERP times the depth: at w
// rad/s a step passes it by up to w h, and what comes back is ERP w, a restitution nobody asked for. The row
// of a stop that the coordinate is about to pass is therefore put in before. ODE's row for an upper stop asks
// for v+ <= -(ERP / h) (q - stop); with the stop at q - 1 and ERP = -(left to the stop) it is v+ <= left / h:
// the coordinate lands on the stop. A bouncing stop turns it back, v+ <= -bounce v, if the step reaches it.
bool Joints::catch_approach(const Link& link, const Approach& approach, bool& caught) const {
  const double above = approach.high - approach.q, below = approach.q - approach.low;
  const bool on_stop = std::min(above, below) < kOnStop;
  const bool rises = on_stop ? above < below : approach.rate > 0;
  const double left = rises ? above : below;
  const double way = step_ * (rises ? approach.rate : -approach.rate);
  if (!on_stop && !(kCatchSteps * way > left)) {
    let_go(link, approach, caught);
    return false;
  }
  const double bounce = way > left ? link.joint->axes[approach.axis].stop->restitution : 0.0;
  if (rises)
    set_stop(link, approach.axis, -dInfinity, approach.q - 1, -left, bounce);
  else
    set_stop(link, approach.axis, approach.q + 1, dInfinity, -left, bounce);
  caught = true;
  return true;
}

/// Back to the stop as it is.
void Joints::let_go(const Link& link, const Approach& approach, bool& caught) const {
  if (!caught) return;
  set_stop(link, approach.axis, approach.low, approach.high, erp_,
           link.joint->axes[approach.axis].stop->restitution);
  caught = false;
}

void Joints::set_stop(const Link& link, std::size_t axis, double low, double high, double erp,
                      double bounce) const {
  const model::JointKind kind = link.joint->kind;
  const int group = kParamGroup * ode_axis(kind, axis);
  set_parameter(link.id, kind, dParamLoStop + group, low);
  set_parameter(link.id, kind, dParamHiStop + group, high);
  set_parameter(link.id, kind, dParamStopERP + group, erp);
  set_parameter(link.id, kind, dParamBounce + group, bounce);
}

void Joints::read_torques(std::span<const double> given, std::vector<double>& tau,
                          std::vector<double>& tau_servo) {
  const std::span<const Vec3> axes = sensors_.axes();
  tau.assign(axes.size(), 0);
  tau_servo.assign(axes.size(), 0);
  for (const Link& link : links_) {
    if (link.id == nullptr) continue;
    const auto first = as_index(link.joint->first_dof);
    const auto count = as_index(dof_count(link.joint->kind));
    const std::span<const Vec3> own = axes.subspan(first, count);
    if (!given.empty()) std::copy_n(given.data() + first, count, tau.data() + first);
    if (link.by_motor) add_feedback(*link.by_motor, link.joint->slides(0), own, tau.data() + first);
    if (link.servos.empty()) continue;
    for (const ServoMotor& servo : link.servos)
      add_feedback(*servo.feedback, link.joint->slides(servo.axes[0]),
                   own.subspan(servo.axes[0], servo.axes.size()), tau_servo.data() + first + servo.axes[0]);
    for (std::size_t k = first; k < first + count; ++k) tau[k] += tau_servo[k];
  }
}

void Joints::add_torques(std::span<const double> torques, const model::State& state) const {
  for (const Link& link : links_)
    if (link.id != nullptr)
      ode::add_torques(link.id, *link.joint, torques.data() + link.joint->first_dof, state, link.child.id,
                       link.parent.id);
}

}  // namespace handsim::engine::ode
