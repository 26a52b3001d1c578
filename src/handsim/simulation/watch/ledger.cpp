#include "handsim/simulation/watch/ledger.h"

#include <array>

#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

using model::Effect;

namespace {

Json entries_json(const std::vector<LedgerEntry>& entries) {
  Json out = Json::array();
  for (const LedgerEntry& entry : entries) {
    Json row = {{"name", entry.name}, {"steps", entry.ran}};
    if (entry.rows > 0) row["rows_per_step"] = entry.rows;
    row["ns_per_step"] = entry.ns_per_step ? Json(*entry.ns_per_step) : Json();
    row["how"] = entry.how;
    out.push_back(std::move(row));
  }
  return out;
}

}  // namespace

Ledger::Ledger(const Watched& watched)
    : model_(watched.scene.model),
      effects_(watched.scene.spec.solver.effects),
      rows_(watched.scene.spec.solver.engine() != engine::EngineKind::articulated) {
  if (watched.controller && watched.controller->plan().form == control::Form::implicit_gain)
    driven_rows_ = static_cast<long>(watched.controller->plan().axes.size());
  for (const model::Joint& joint : model_.joints) {
    // A slider holds five of six relative freedoms, as a hinge does.
    joint_rows_ += 6 - model::dof_count(joint.kind);
    for (const model::JointAxis& axis : joint.axes) tissue_rows_ += axis.tissue ? 1 : 0;
  }
}

Effect Ledger::kind_of(const engine::Contact& contact) const {
  const model::Part a = model_.shapes[as_index(contact.shape_a)].part;
  const model::Part b = model_.shapes[as_index(contact.shape_b)].part;
  if (a == model::Part::ground || b == model::Part::ground) return Effect::ground_contact;
  if (a == model::Part::object || b == model::Part::object) return Effect::object_contact;
  return Effect::self_contact;
}

void Ledger::add_rows(Effect effect, long rows) {
  if (rows == 0) return;
  ++count(effect).steps;
  count(effect).rows += rows;
}

void Ledger::update(Step& step) {
  const engine::StepReport& report = step.report;
  if (step.times) {
    const auto since = std::chrono::steady_clock::now() - step.times->watched;
    ++timed_;
    step_ns_ += step.times->step;
    check_ns_ += std::chrono::duration<double, std::nano>(since).count();
    control_ns_ += step.times->control;
    servo_ns_ += report.servo_ns;
    collide_ns_ += report.collide_ns;
    tissue_ns_ += report.tissue_ns;
  }
  ++steps_;
  contacts_ += report.contacts;
  collide_calls_ += report.collide_calls;
  add_rows(Effect::joint_stops, report.stop_rows);
  if (effects_.has(Effect::passive_tissue)) add_rows(Effect::passive_tissue, tissue_rows_);
  if (effects_.has(Effect::actuation)) add_rows(Effect::actuation, driven_rows_);
  std::array<long, model::kEffectCount> touching{};
  for (const auto& contact : step.engine.contacts()) ++touching[static_cast<std::size_t>(kind_of(contact))];
  for (const Effect effect : {Effect::object_contact, Effect::self_contact, Effect::ground_contact})
    add_rows(effect, touching[static_cast<std::size_t>(effect)]);
  if (effects_.has(Effect::friction)) add_rows(Effect::friction, 2L * report.contacts);
}

template <class Archive, class Self>
void Ledger::serialize(Archive& archive, Self& self) {
  archive(self.timed_, self.steps_, self.contacts_, self.collide_calls_, self.step_ns_, self.check_ns_,
          self.collide_ns_, self.tissue_ns_, self.control_ns_, self.servo_ns_);
  for (auto& count : self.counts_) archive(count.steps, count.rows);
}

void Ledger::save(ArchiveWriter& out) const { serialize(out, *this); }

void Ledger::restore(ArchiveReader& in, const model::State& /*state*/) { serialize(in, *this); }

std::optional<double> Ledger::per_step(double ns) const {
  return timed_ > 0 ? std::optional(ns / static_cast<double>(timed_)) : std::nullopt;
}

std::vector<LedgerEntry> Ledger::phases() const {
  std::vector<LedgerEntry> out;
  out.push_back({"step", steps_, 0, per_step(solver_ns()),
                 "timed on every 16th step: the engine without the phases below"});
  if (effects_.any_contact()) out.push_back({"collide", steps_, 0, per_step(collide_ns_), "timed"});
  if (effects_.has(Effect::passive_tissue) && rows_)
    out.push_back({"tissue", steps_, 0, per_step(tissue_ns_), "timed"});
  if (effects_.has(Effect::actuation))
    out.push_back({"control", steps_, 0, per_step(control_ns_ + servo_ns_),
                   "timed: sensing, control, setting the drives"});
  out.push_back({"check", steps_, 0, per_step(check_ns_), "timed"});
  return out;
}

LedgerEntry Ledger::entry(Effect effect) const {
  const double n = steps_ > 0 ? static_cast<double>(steps_) : 1.0;
  const Count& mine = counts_[static_cast<std::size_t>(effect)];
  LedgerEntry out{std::string(model::name(effect)), mine.steps, static_cast<double>(mine.rows) / n, {}, ""};
  if (effect == Effect::gravity || effect == Effect::wrist_motion) {
    out.ran = steps_;
    out.how = "acts within the step without rows of its own: not told apart";
    return out;
  }
  double ns = 0;
  if (rows_) {
    long all_rows = joint_rows_ * steps_;
    for (const Count& any : counts_) all_rows += any.rows;
    if (all_rows > 0) ns = static_cast<double>(mine.rows) / static_cast<double>(all_rows) * solver_ns();
    out.ns_per_step = per_step(ns);
    out.how = "the step's time by share of constraint rows";
  } else {
    out.how = "solved with the motion, without rows of its own: not told apart";
  }
  if (effect != Effect::actuation) return out;
  // Torques have no rows; servos have. The control phase belongs to both.
  out.ran = steps_;
  out.ns_per_step = per_step(ns + control_ns_ + servo_ns_);
  out.how = rows_ && driven_rows_ > 0 ? "the control phase, and the step's time by share of constraint rows"
                                      : "the control phase";
  return out;
}

double Ledger::control_share() const {
  return step_ns_ > 0 ? (control_ns_ + servo_ns_) / (step_ns_ - servo_ns_) : 0;
}

std::vector<LedgerEntry> Ledger::effects() const {
  std::vector<LedgerEntry> out;
  for (int i = 0; i < model::kEffectCount; ++i)
    if (effects_.has(static_cast<Effect>(i))) out.push_back(entry(static_cast<Effect>(i)));
  return out;
}

void Ledger::add_summary(SummaryJson& out) const {
  out.json["counts"]["contacts"] = contacts_;
  out.json["counts"]["collide_calls"] = collide_calls_;
  if (Json& control = out.json["control"]; !control.is_null()) control["share_of_step"] = control_share();
  out.json["ledger"] = {{"phases", entries_json(phases())}, {"effects", entries_json(effects())}};
}

}  // namespace handsim::simulation
