#include "handsim/engine/articulated/dynamics/smooth.h"

#include <algorithm>
#include <limits>

namespace handsim::engine::articulated {

namespace {

/// Errors of single steps add up over a run: each is held to this share of the tolerance.
constexpr double kStepShare = 0.05;
constexpr double kSmallestStep = 1e-12;  ///< [s]
constexpr double kRejected = 0.9;
constexpr long kMostTries = 1'000'000;  ///< steps of the method in one of the engine

std::size_t weighed(const Topology& topology) {
  std::size_t count = 0;
  for (const Node& node : topology.nodes)
    count += static_cast<std::size_t>(rate_count(node.kind) + position_count(node.kind));
  return std::max<std::size_t>(count, 1);
}

}  // namespace

Smooth::Smooth(const model::Model& model, const Settings& settings, Mechanism& mechanism, Loops* loops)
    : model_(model),
      settings_(settings),
      mechanism_(mechanism),
      loops_(loops),
      method_(
          mechanism.q().size() + mechanism.u().size(), weighed(mechanism.topology()),
          [this](double t, std::span<const double> y, std::span<double> out) { return slope(t, y, out); }),
      y_(mechanism.q().size() + mechanism.u().size()),
      next_(y_.size()),
      before_(mechanism.u().size()),
      driven_(settings.effects.has(model::Effect::wrist_motion) && !model.drives.empty()) {
  bases_before_.reserve(model.drives.size());
}

void Smooth::accelerate() {
  mechanism_.kernel().prepare_smooth(mechanism_.tree());
  if (loops_)
    loops_->solve(std::nullopt);
  else
    mechanism_.kernel().solve(mechanism_.tree());
}

bool Smooth::slope(double t, std::span<const double> y, std::span<double> out) {
  const std::span<double> q = mechanism_.q(), u = mechanism_.u(), du = mechanism_.du();
  std::copy_n(y.begin(), q.size(), q.begin());
  std::copy(y.begin() + static_cast<std::ptrdiff_t>(q.size()), y.end(), u.begin());
  if (driven_) {
    place_bases(t, t >= next_key_time_ ? model::KeySide::before : model::KeySide::after);
    mechanism_.update_bases();
  }
  if (!mechanism_.kernel().kinematics(mechanism_.tree())) return false;
  accelerate();
  mechanism_.kernel().position_rates(mechanism_.tree(), out.data());
  std::ranges::copy(du, out.begin() + static_cast<std::ptrdiff_t>(q.size()));
  return true;
}

void Smooth::place_bases(double t, model::KeySide side) {
  for (const model::Drive& drive : model_.drives) {
    const Pose x_WD = drive.motion.at(t);
    const model::PoseRate rate = drive.motion.rate(t, side), change = drive.motion.acceleration(t, side);
    BaseMotion& base = mechanism_.base(drive.body);
    base.pose = x_WD * drive.frame.inverse();
    // The drive moves D's origin; the body's own is `r` from it.
    const Vec3 r = base.pose.p - x_WD.p;
    base.w = rate.w;
    base.v = rate.v + rate.w.cross(r);
    base.dw = change.w;
    base.dv = change.v + change.w.cross(r) + rate.w.cross(rate.w.cross(r));
  }
}

/// A drive that sets off with a jerk takes the joints along: the rates' change, less what goes on without it.
void Smooth::apply_velocity_jumps(double t) {
  std::vector<BaseMotion>& was = bases_before_;
  was.clear();
  for (const model::Drive& drive : model_.drives) was.push_back(mechanism_.base(drive.body));
  place_bases(t, model::KeySide::after);
  bool jumps = false;
  for (std::size_t i = 0; i < was.size(); ++i) {
    BaseMotion& base = mechanism_.base(model_.drives[i].body);
    const BaseMotion now = base;
    base = was[i];
    base.pose = now.pose;
    base.dv = now.v - was[i].v;
    base.dw = now.w - was[i].w;
    jumps = jumps || base.dv.norm() > 1e-12 || base.dw.norm() > 1e-12;
  }
  if (jumps) {
    const std::span<double> du = mechanism_.du(), u = mechanism_.u();
    mechanism_.update_bases();
    mechanism_.kernel().kinematics(mechanism_.tree());
    accelerate();
    std::ranges::copy(du, before_.begin());
    for (const model::Drive& drive : model_.drives)
      mechanism_.base(drive.body).dv = mechanism_.base(drive.body).dw = Vec3::Zero();
    mechanism_.update_bases();
    accelerate();
    for (std::size_t i = 0; i < u.size(); ++i) u[i] += before_[i] - du[i];
  }
  place_bases(t, model::KeySide::after);
}

double Smooth::next_key(double t) const {
  double next = std::numeric_limits<double>::infinity();
  if (!driven_) return next;
  for (const model::Drive& drive : model_.drives)
    for (const model::PoseKey& key : drive.motion.keys)
      if (key.time > t) next = std::min(next, key.time);
  return next;
}

bool Smooth::advance(double from, double to) {
  for (double t = from; t < to;) {
    next_key_time_ = next_key(t);
    if (driven_) apply_velocity_jumps(t);
    const double end = std::min(to, next_key_time_);
    std::ranges::copy(mechanism_.q(), y_.begin());
    std::ranges::copy(mechanism_.u(), y_.begin() + static_cast<std::ptrdiff_t>(mechanism_.q().size()));
    if (!integrate(t, end)) return false;
    t = end;
  }
  mechanism_.kernel().prepare_smooth(mechanism_.tree());
  mechanism_.kernel().normalise(mechanism_.tree());
  return mechanism_.kernel().kinematics(mechanism_.tree());
}

/// A stretch without keyframes, from y_.
bool Smooth::integrate(double from, double to) {
  if (settings_.articulated().method == ArticulatedMethod::dormand_prince) {
    if (!integrate_adaptively(from, to)) return false;
  } else if (!method_.step4(from, to - from, y_)) {
    return false;
  }
  if (driven_) {
    place_bases(to, to >= next_key_time_ ? model::KeySide::before : model::KeySide::after);
    mechanism_.update_bases();
  }
  return close_loops();
}

/// Takes y_ over, onto the loops.
bool Smooth::close_loops() {
  const std::span<double> q = mechanism_.q(), u = mechanism_.u();
  std::copy_n(y_.begin(), q.size(), q.begin());
  std::copy(y_.begin() + static_cast<std::ptrdiff_t>(q.size()), y_.end(), u.begin());
  if (!loops_) return true;
  if (!mechanism_.kernel().kinematics(mechanism_.tree()) || !(loops_->close() < kOpen)) return false;
  std::ranges::copy(q, y_.begin());
  std::ranges::copy(u, y_.begin() + static_cast<std::ptrdiff_t>(q.size()));
  return true;
}

bool Smooth::integrate_adaptively(double from, double to) {
  method_.forget_start();
  if (size_ == 0) size_ = to - from;
  long tries = kMostTries;
  for (double t = from; t < to;) {
    // The last two steps of a stretch are equal: a short one would say little of the next.
    const double left = to - t;
    const double h = size_ >= left ? left : (2 * size_ > left ? 0.5 * left : size_);
    if ((h < kSmallestStep && h < left) || --tries < 0) return false;
    const double error = method_.try_step8(t, h, y_, kStepShare * settings_.articulated().tolerance, next_);
    // Written so that NaN is rejected.
    if (!(error >= 0 && error <= 1)) {
      size_ = h * (error > 1 ? std::min(kRejected, step_factor8(error)) : 0.1);
      continue;
    }
    t = h == left ? to : t + h;
    y_.swap(next_);
    size_ = h * step_factor8(error);
    if (t < to && loops_) {
      if (driven_) place_bases(t, model::KeySide::after);
      if (!close_loops()) return false;
    }
    method_.forget_start();
  }
  return true;
}

}  // namespace handsim::engine::articulated
