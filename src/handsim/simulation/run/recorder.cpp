#include "handsim/simulation/run/recorder.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace handsim::simulation {

namespace {

std::string caption(const std::string& name, double time) {
  return fmt::format("{}, t = {:.2f} s", name, time);
}

}  // namespace

Recorder::Recorder(const Simulation& simulation, const RunOptions& options)
    : simulation_(simulation), step_(simulation.scene().spec.solver.step), tables_(simulation, options) {
  plan_pictures(options);
  if (options.video)
    film_.emplace(simulation.scene(), *options.video, simulation.steps(), simulation.step_count());
}

void Recorder::plan_pictures(const RunOptions& options) {
  const scene::Plans& plans = simulation_.scene().plans;
  if (!options.pose_pictures) return plan_frames(options.frames);
  if (!plans.grasps.empty()) return plan_phases(plans.grasps.front().phases);
  const Climbs* climbs = simulation_.find<Climbs>();
  if (!climbs) return plan_poses();
  // Before the load; those under it are chosen at the end.
  climb_ = &climbs->each().front();
  const auto& phases = plans.climbs.front().phases;
  plan_phases({phases[0], phases[1]});
}

/// The first at the start, the last at the end.
void Recorder::plan_frames(int frames) {
  const long first = simulation_.steps();
  const long steps = simulation_.step_count() - first;
  for (int k = 0; k < frames; ++k) {
    const double share = frames == 1 ? 1 : static_cast<double>(k) / (frames - 1);
    planned_.push_back({first + std::lround(share * static_cast<double>(steps)), "", Vec3::Zero()});
  }
}

/// One at the end of every hold of the first hand's program.
void Recorder::plan_poses() {
  const long steps = simulation_.step_count();
  for (const control::Phase& phase : simulation_.controller()->plan().hands.front().trajectory.phases()) {
    const long step = std::isfinite(phase.end) ? std::min(steps, std::lround(phase.end / step_)) : steps;
    if (std::lround(phase.arrive / step_) > steps) return;
    if (step < simulation_.steps()) continue;
    planned_.push_back({step, caption(phase.pose, static_cast<double>(step) * step_), Vec3::Zero()});
  }
}

/// The moment at which a shake has moved the hand furthest: along x in the first level, y in the second, z in
/// the third.
Recorder::Planned Recorder::extreme_of(const scene::TaskPhase& phase, std::size_t level) const {
  Planned out{std::lround(phase.end / step_), caption(phase.name, phase.end), Vec3::Zero()};
  std::vector<model::Shake> of_phase;
  for (const model::Drive& drive : simulation_.model().drives)
    for (const model::Shake& shake : drive.motion.shakes)
      if (shake.start >= phase.start - step_ / 2 && shake.end() <= phase.end + step_ / 2)
        of_phase.push_back(shake);
  if (of_phase.empty()) return out;
  const model::Shake& shake = of_phase[2 * level % of_phase.size()];
  const long last = std::lround(shake.end() / step_);
  for (long i = std::lround(shake.start / step_); i <= last; ++i) {
    const Vec3 moved = shake.displacement(static_cast<double>(i) * step_);
    if (moved.norm() <= out.shaken.norm()) continue;
    out = {i,
           fmt::format("{}: {:.0f} mm, t = {:.2f} s", phase.name, 1e3 * moved.norm(),
                       static_cast<double>(i) * step_),
           moved};
  }
  return out;
}

/// One at the start, one at the end of every phase, and one at the furthest point of a shake.
void Recorder::plan_phases(const std::vector<scene::TaskPhase>& phases) {
  planned_.push_back({0, "start", Vec3::Zero()});
  std::size_t level = 0;
  for (const scene::TaskPhase& phase : phases) {
    const long step = std::lround(phase.end / step_);
    if (phase.name.starts_with("shake")) {
      if (Planned extreme = extreme_of(phase, level++); extreme.step <= simulation_.step_count())
        planned_.push_back(std::move(extreme));
      continue;
    }
    if (step <= simulation_.step_count())
      planned_.push_back({step, caption(phase.name, static_cast<double>(step) * step_), Vec3::Zero()});
  }
}

void Recorder::show(PictureState moment, std::string caption) {
  moment.caption = std::move(caption);
  moments_.push_back(std::move(moment));
}

void Recorder::record_climb() {
  const ClimbFigures figures = climb_->figures();
  if (figures.failed || figures.carried <= 0) return;
  if (loaded_.empty() || figures.carried >= loaded_.back().first + kGripEvery)
    loaded_.emplace_back(figures.carried, picture_state(simulation_.engine()));
}

/// Under the load: half of what is carried, the last that is carried, and after the failure.
void Recorder::finish_climb() {
  const ClimbFigures figures = climb_->figures();
  if (!loaded_.empty()) {
    const auto half = std::ranges::find_if(
        loaded_, [&](const auto& moment) { return moment.first >= figures.carried / 2; });
    show(half->second, fmt::format("{:.0f} N", half->first));
    show(loaded_.back().second, fmt::format("{:.0f} N", loaded_.back().first));
  }
  if (figures.failed) show(picture_state(simulation_.engine()), "after failure");
}

void Recorder::record(long step) {
  tables_.record(step);
  for (; taken_ < planned_.size() && planned_[taken_].step == step; ++taken_) {
    const std::string& caption = planned_[taken_].caption;
    PictureState moment = picture_state(simulation_.engine());
    moment.shaken = planned_[taken_].shaken;
    show(std::move(moment),
         caption.empty() ? fmt::format("t = {:.3f} s", simulation_.state().time) : caption);
  }
  if (climb_) record_climb();
  if (film_) film_->record(step, simulation_.engine());
}

void Recorder::finish() {
  if (climb_) finish_climb();
  tables_.finish();
}

}  // namespace handsim::simulation
