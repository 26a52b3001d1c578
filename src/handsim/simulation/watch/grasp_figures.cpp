#include "handsim/simulation/watch/grasp_figures.h"

#include <algorithm>

#include <fmt/format.h>

#include "handsim/model/shape_extent.h"
#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

namespace {

/// Parts that bear less than this share of the grip say nothing of its friction.
constexpr double kBearing = 1e-3;

template <class Archive, class T>
void carry_grip(Archive& archive, T& grip) {
  archive(grip.time);
  archive.list(grip.parts, [](auto& each, auto& part) { carry_part(each, part); });
  archive(grip.contacts, grip.others, grip.normal, grip.friction_used, grip.wrenches.force_closure,
          grip.wrenches.epsilon, grip.wrenches.volume);
}

template <class Archive, class T>
void serialize_figures(Archive& archive, T& figures) {
  archive(figures.complete);
  carry_grip(archive, figures.hold);
  carry_grip(archive, figures.after);
  archive(figures.slip, figures.spin, figures.shaken_shift, figures.shaken_time, figures.shift, figures.turn,
          figures.held, figures.left_time, figures.last_part, figures.moved_time);
}

/// Normal force of all contacts of a contact's two shapes [N], by which friction over load is.
double normal_of_pair(std::span<const engine::Contact> contacts, const engine::Contact& one) {
  double out = 0;
  for (const engine::Contact& each : contacts)
    if (each.shape_a == one.shape_a && each.shape_b == one.shape_b) out += each.normal_force();
  return out;
}

}  // namespace

GraspWatch::GraspWatch(const model::Model& model, const scene::GraspPlan& plan, double step)
    : model_(model), rules_(model), half_step_(step / 2), part_of_shape_(model.shapes.size()) {
  const model::HandIndex& hand = model.hands[plan.hand];
  palm_ = as_index(hand.palm);
  for (const model::ObjectIndex& object : model.objects)
    if (object.name == plan.object) object_ = as_index(object.body.value_or(model::kWorld));
  for (std::size_t i = 0; i < model.shapes.size(); ++i) {
    const model::Shape& shape = model.shapes[i];
    if (std::ranges::find(hand.bodies, shape.body) != hand.bodies.end())
      part_of_shape_[i] = hand_part(shape.part);
    if (static_cast<std::size_t>(shape.body) == object_) length_ = std::max(length_, model::reach(shape));
  }
  hold_end_ = plan.phase("hold")->end;
  lift_start_ = plan.phase("lift")->start;
  slip_start_ = std::max(plan.phase("hold")->start, hold_end_ - kSlipSpan);
  end_ = plan.end();
  figures_.name = hand.name + "." + plan.object;
}

Pose GraspWatch::object_in_palm(const model::State& state) const {
  return state.bodies[palm_].pose().inverse() * state.bodies[object_].pose();
}

Grip GraspWatch::grip(const engine::Engine& engine) const {
  Grip out;
  out.time = engine.state().time;
  PartForces parts;
  std::array<double, kHandParts.size()> limits{};
  std::vector<WrenchContact> wrenches;
  const Vec3 centre = engine.state().bodies[object_].p;
  for (const engine::Contact& contact : engine.contacts()) {
    const std::size_t a = as_index(model_.shapes[as_index(contact.shape_a)].body),
                      b = as_index(model_.shapes[as_index(contact.shape_b)].body);
    if (a != object_ && b != object_) continue;
    const std::optional<std::size_t> part =
        part_of_shape_[as_index(a == object_ ? contact.shape_b : contact.shape_a)];
    const double normal = contact.normal_force();
    if (normal <= 0) continue;
    if (!part) {
      ++out.others;
      continue;
    }
    parts.add(*part, contact);
    out.normal += normal;
    ++out.contacts;
    WrenchContact wrench;
    const model::Material between =
        rules_.between(model_.shapes[as_index(contact.shape_a)], model_.shapes[as_index(contact.shape_b)]);
    wrench.friction = between.friction;
    if (between.friction_over_load)
      wrench.friction *= between.friction_over_load->factor(normal_of_pair(engine.contacts(), contact));
    wrench.spinning = between.spinning(wrench.friction, contact.depth);
    wrench.position = contact.position - centre;
    wrench.normal = a == object_ ? contact.normal : Vec3(-contact.normal);
    wrenches.push_back(wrench);
    limits[*part] += wrench.friction * normal;
  }
  for (std::size_t i = 0; i < limits.size(); ++i)
    if (parts.each[i].normal > kBearing * out.normal && limits[i] > 0)
      out.friction_used = std::max(out.friction_used, parts.each[i].friction / limits[i]);
  out.parts = parts.touched();
  out.wrenches = wrench_space(wrenches, length_);
  return out;
}

void GraspWatch::save(ArchiveWriter& out) const {
  out(at_slip_start_, at_hold_end_);
  serialize_figures(out, figures_);
}

void GraspWatch::restore(ArchiveReader& in, double time) {
  in(at_slip_start_, at_hold_end_);
  serialize_figures(in, figures_);
  figures_.watched_time = time;
}

void GraspWatch::update(const engine::Engine& engine) {
  if (figures_.complete) return;
  const double time = engine.state().time;
  figures_.watched_time = time;
  if (time >= lift_start_ - half_step_) watch_touch(engine);
  if (time < slip_start_ - half_step_) return;
  const Pose now = object_in_palm(engine.state());
  if (!at_slip_start_) at_slip_start_ = now;
  if (!at_hold_end_) {
    if (time < hold_end_ - half_step_) return;
    at_hold_end_ = now;
    figures_.hold = grip(engine);
    const double span = std::max(hold_end_ - slip_start_, 2 * half_step_);
    figures_.slip = (now.p - at_slip_start_->p).norm() / span;
    figures_.spin = rotation_vector(now.q * at_slip_start_->q.conjugate()).norm() / span;
  }
  const double shift = (now.p - at_hold_end_->p).norm();
  if (shift > figures_.shaken_shift) {
    figures_.shaken_shift = shift;
    figures_.shaken_time = time;
    if (!figures_.moved_time && figures_.failed()) figures_.moved_time = time;
  }
  if (time >= end_ - half_step_) finish(engine, now);
}

/// Notes which part of the hand touched the object last, and since when none does.
void GraspWatch::watch_touch(const engine::Engine& engine) {
  const engine::Contact* deepest = nullptr;
  std::optional<std::size_t> part;
  for (const engine::Contact& contact : engine.contacts()) {
    const std::size_t a = as_index(model_.shapes[as_index(contact.shape_a)].body),
                      b = as_index(model_.shapes[as_index(contact.shape_b)].body);
    if ((a != object_ && b != object_) || contact.depth <= 0) continue;
    const std::optional<std::size_t> touching =
        part_of_shape_[as_index(a == object_ ? contact.shape_b : contact.shape_a)];
    if (!touching || (deepest != nullptr && deepest->depth >= contact.depth)) continue;
    deepest = &contact;
    part = touching;
  }
  if (part) {
    figures_.left_time.reset();
    figures_.last_part = kHandParts[*part];
  } else if (!figures_.left_time) {
    figures_.left_time = engine.state().time;
  }
}

void GraspWatch::finish(const engine::Engine& engine, const Pose& now) {
  figures_.complete = true;
  figures_.after = grip(engine);
  figures_.shift = (now.p - at_hold_end_->p).norm();
  figures_.turn = rotation_vector(now.q * at_hold_end_->q.conjugate()).norm();
  figures_.held = figures_.shift <= kHeldShift && figures_.turn <= kHeldTurn &&
                  figures_.shaken_shift <= kShakenShift && figures_.after.contacts > 0 &&
                  figures_.after.others == 0 && figures_.hold.others == 0;
}

Outcome GraspFigures::outcome() const {
  if (held) return Outcome::held;
  if (left_time && (complete || failed() || lost(watched_time))) return Outcome::lost;
  return complete || failed() ? Outcome::moved : Outcome::cut_off;
}

double GraspFigures::margin() const {
  return 1 - std::max({shaken_shift / kShakenShift, shift / kHeldShift, turn / kHeldTurn});
}

std::string GraspFigures::told() const {
  std::string out = word(outcome());
  if (outcome() == Outcome::lost)
    out += fmt::format(" at {:.3f} s, {}", *left_time,
                       last_part.empty() ? "before it was lifted" : "last touched by the " + last_part);
  if (outcome() == Outcome::moved && moved_time) out += fmt::format(" at {:.3f} s", *moved_time);
  return out;
}

Grasps::Grasps(const Watched& watched) {
  for (const scene::GraspPlan& plan : watched.scene.plans.grasps)
    each_.emplace_back(watched.scene.model, plan, watched.scene.spec.solver.step);
}

bool Grasps::failed() const {
  return std::ranges::any_of(each_, [](const GraspWatch& grasp) { return grasp.figures().failed(); });
}

bool Grasps::decided(double now) const {
  return std::ranges::any_of(each_, [now](const auto& grasp) { return grasp.figures().decided(now); });
}

/// Movements of grasped objects are always judged. A lost object has failed, however the run goes on.
void Grasps::add_verdicts(const scene::Criteria& criteria, std::vector<Verdict>& out) const {
  for (const GraspWatch& each : each_) {
    const GraspFigures& grasp = each.figures();
    const auto add = [&](const char* name, const char* unit, bool known, double measured,
                         std::optional<double> limit, double time) {
      out.push_back({name, unit, known ? std::optional(measured) : std::nullopt, limit, time, grasp.name});
    };
    const bool complete = grasp.complete;
    const int others = grasp.hold.others + grasp.after.others;
    add("grasp_shaken", "m", complete || grasp.failed(), grasp.shaken_shift, kShakenShift, grasp.shaken_time);
    add("grasp_shift", "m", complete, grasp.shift, kHeldShift, grasp.after.time);
    add("grasp_turn", "rad", complete, grasp.turn, kHeldTurn, grasp.after.time);
    add("grasp_others", "", complete || others > 0, others, 0, grasp.after.time);
    add("grasp_slip", "m/s", grasp.hold_measured(), grasp.slip, criteria.grasp_slip, grasp.hold.time);
  }
}

void Grasps::add_summary(SummaryJson& out) const {
  const auto grip_json = [](const Grip& grip) {
    return Json{{"time_s", grip.time},
                {"contacts", grip.contacts},
                {"contacts_with_other_things", grip.others},
                {"normal_force_N", grip.normal},
                {"friction_used", grip.friction_used},
                {"parts", parts_json(grip.parts)},
                {"force_closure", grip.wrenches.force_closure},
                {"epsilon", grip.wrenches.epsilon},
                {"wrench_volume", grip.wrenches.volume}};
  };
  for (const GraspFigures& grasp : figures()) {
    out.json["grasps"].push_back({{"name", grasp.name},
                                  {"complete", grasp.complete},
                                  {"held", grasp.held},
                                  {"outcome", grasp.told()},
                                  {"margin", grasp.margin_measured() ? Json(grasp.margin()) : Json()},
                                  {"force_closure_disagrees", grasp.disagree()},
                                  {"slip_m_per_s", grasp.slip},
                                  {"spin_rad_per_s", grasp.spin},
                                  {"shaken_shift_m", grasp.shaken_shift},
                                  {"shift_m", grasp.shift},
                                  {"turn_rad", grasp.turn},
                                  {"end_of_hold", grip_json(grasp.hold)},
                                  {"after_shake", grip_json(grasp.after)}});
    if (grasp.outcome() == Outcome::lost) out.json["grasps"].back()["lost_time_s"] = *grasp.left_time;
    if (grasp.moved_time) out.json["grasps"].back()["moved_time_s"] = *grasp.moved_time;
  }
}

}  // namespace handsim::simulation
