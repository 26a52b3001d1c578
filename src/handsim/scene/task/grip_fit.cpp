#include "handsim/scene/task/grip_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>

#include <fmt/format.h>

#include "handsim/control/gains.h"
#include "handsim/core/units.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/shape_extent.h"

namespace handsim::scene {

namespace {

constexpr double kTouchDepth = 1e-5;  ///< Depth of a touch without force [m].
/// Share of friction that the planned forces may use: the rest is for the shake.
constexpr double kFrictionShare = 0.6;
/// Share of the normal forces that may be left over: springs give way by as much.
constexpr double kUnbalanced = 0.1;
constexpr double kMostUnplanned = 0.5;  ///< Share of the pads' forces that may be others than planned.
/// Largest use() that forces are not raised for: below 2 nearly all of 80 grasps were held, few above.
constexpr double kUse = 1.9, kMostUse = 2.2;
/// Forces within this share are near enough.
constexpr double kEnough = 0.03;
constexpr int kRaises = 3;
/// Weights in the choice of a place: distance from the named one in hand lengths, forces off those asked,
/// friction, use() up to a most, forces that are not planned, and in a wrap a thumb beside the fingers; there
/// use() beyond an easy one counts as such, and so do far more forces that are not planned.
constexpr double kFarWeight = 2, kOffWeight = 0.4, kFrictionWeight = 0.6, kUseWeight = 0.1,
                 kUnplannedWeight = 0.1, kMostWrong = 5, kBesideWeight = 1.5, kEasyUse = 1.2,
                 kBadlyPlanned = 5, kEasyUnplanned = 0.4;
/// First and last step to a better place [hand lengths]; the thumb's turn in a step of one hand length [rad].
constexpr double kFirstStep = 0.06, kLastStep = 6e-3, kTurnOfStep = 2;
/// Turns of the thumb from its named pose, and places beyond the named one in hand lengths, tried first.
constexpr std::array kTurns = {0.0, -15 * kDegree, -30 * kDegree, -45 * kDegree};
constexpr std::array kShifts = {0.0, 0.06, 0.12};
constexpr int kRounds = 8;       ///< Rounds in which depths of pads and forces come to agree.
constexpr double kWideOpen = 3;  ///< Times the way from open to closed by which fingers open at most.
/// Distance from the palm at which an object starts, and the step towards the palm [m].
constexpr double kFar = 0.4, kNearer = 5e-3;
constexpr int kHalvings = 10;  ///< Then the place is within 5 um.

std::vector<double> angles_of(const TaskSite& site, const std::string& pose, const control::HandAxes& axes) {
  Diagnostics ignored;  // poses are checked with the program
  return control::pose_angles(pose, site.scene.control->poses->poses.at(pose), axes, ignored);
}

/// Where the object lies in the hand, and how far the thumb is turned from its named pose [rad].
struct Place {
  Vec3 p = Vec3::Zero();  ///< [m]
  double turn = 0;
};

class Fit {
 public:
  Fit(const TaskSite& site, const GripSpec& spec, const GripPlace& place, const TaskSpec& task)
      : site_(site),
        spec_(spec),
        place_(place),
        task_(task),
        hand_(site),
        closing_(hand_, angles_of(site, task.open, hand_.axes()),
                 angles_of(site, task.closed.front(), hand_.axes())),
        palm_(hand_.watch_palm()),
        depth_(hand_.model().bodies.size(), kTouchDepth) {
    out_.strength = hand::grip_strength(spec.strength, site.entry.person);
    strength_ = own_strength();
  }

  FittedGrip run() {
    search();
    press_as_needed();
    report();
    out_.open = pose(closing_.open());
    out_.touch = pose(touch_);
    out_.press = pose(pressing());
    out_.press.pressing = true;
    return std::move(out_);
  }

 private:
  /// Over the strength of the controller's table.
  double own_strength() const {
    const auto& reference = site_.scene.control->controller.grip_strength;
    return reference ? out_.strength.own / *reference : 1;
  }
  double asked(model::Part part) const {
    const auto found = spec_.forces.find(part);
    return found == spec_.forces.end() ? 0 : strength_ * found->second;
  }

  /// A thumb whose force is named is turned to where it presses so.
  bool thumb_turns() const { return spec_.forces.contains(model::Part::thumb); }

  /// Closes the hand on the object at a place, and finds the forces. @returns what is wrong; 0: nothing
  double grasp_at(const Place& place) {
    const Vec3& p = place.p;
    x_HO_ = {p, place_.at.q};
    closing_.oppose(place.turn);
    depth_.assign(depth_.size(), kTouchDepth);
    if (place_.on_palm) put_on_palm(-kFar, closing_.open(), false);
    opens_ = closing_.open_clear(x_HO_, place_.from);
    out_.x_HO = x_HO_;
    q_ = touch_ = closing_.close(depth_);

    for (int round = 0; round < kRounds; ++round) {
      compute_forces();
      press_deeper();
    }
    compute_forces();
    sum_forces();
    return wrong() + kFarWeight * (p - place_.at.p).norm() / site_.built.size.length;
  }

  /// Forces of the pads that are not those planned, as a share of the sum.
  double unplanned() const {
    double off = 0;
    for (const double force : lacking()) off += std::abs(force);
    return off / (total_force() + 1e-9);
  }

  /// What is wrong with a wrap, in which the thumb opposes the fingers: fingers that do not touch; the
  /// distance across the hand, in hand lengths, of the thumb's force from the fingers'; the share of their
  /// forces that is across the hand; and use() beyond an easy one where the joints press as hard as they can.
  double wrong_of_wrap() {
    double thumb = 0, fingers = 0, of_thumb = 1e-9, of_fingers = 1e-9, across = 0;
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      if (contacts_[i].of_palm) continue;
      const bool is_thumb = hand_.part(contacts_[i].body) == model::Part::thumb;
      (is_thumb ? of_thumb : of_fingers) += normal_force(i);
      (is_thumb ? thumb : fingers) += normal_force(i) * contacts_[i].point.x();
      across += normal_force(i) * std::abs(contacts_[i].normal.x());
    }
    const auto missing =
        std::ranges::count_if(spec_.forces, [&](const auto& of) { return !out_.forces.contains(of.first); });
    const double beside = std::abs(thumb / of_thumb - fingers / of_fingers) / site_.built.size.length;
    return static_cast<double>(missing) + kBesideWeight * (beside + across / (of_thumb + of_fingers)) +
           std::max(0.0, use() * worst_torque().first - kEasyUse) +
           kBadlyPlanned * std::max(0.0, unplanned() - kEasyUnplanned);
  }

  /// How far the grasp is from one that holds with little friction and the forces that are asked.
  double wrong() {
    double off = 0, asked_sum = 0, normal = 0, tangential = 0;
    for (const auto& [part, force] : spec_.forces) {
      const auto found = out_.forces.find(part);
      off += std::abs((found == out_.forces.end() ? 0 : found->second) - asked(part));
      if (found == out_.forces.end()) off += asked(part);
      asked_sum += asked(part);
    }
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      normal += normal_force(i);
      tangential += (balanced_.forces[i] - normal_force(i) * contacts_[i].normal).norm();
    }
    return (opens_ ? 0 : 10) + kUnplannedWeight * unplanned() + 2 * balanced_.unbalanced +
           kOffWeight * off / asked_sum + kFrictionWeight * tangential / (normal + 1e-9) +
           kUseWeight * std::min(use(), kMostWrong) + (thumb_turns() ? wrong_of_wrap() : 0);
  }

  /// From the named place, in smaller steps, to balanced forces; a thumb with a named force turns towards it.
  void search() {
    const double length = site_.built.size.length;
    best_ = {place_.at.p, 0};
    double least = grasp_at(best_);
    const auto better = [&](const Place& trial) {
      if ((trial.p - place_.at.p).norm() > spec_.search * length) return false;
      const double now = grasp_at(trial);
      if (now >= least) return false;
      least = now;
      best_ = trial;
      return true;
    };
    const bool thumb = thumb_turns();
    for (const double turn : kTurns)
      for (const double shift : kShifts)
        if (thumb) better({place_.at.p + shift * length * Vec3::UnitY(), turn});
    for (double step = kFirstStep; step > kLastStep; step /= 2) {
      bool moved = true;
      while (moved) {
        moved = false;
        const Place from = best_;
        for (int k = 0; k < 8; ++k) {
          const double sign = k % 2 == 0 ? step : -step;
          Place trial = from;
          if (k < 6)
            trial.p += sign * length * Vec3::Unit(k / 2);
          else
            trial.turn += sign * kTurnOfStep;
          if ((k / 2 == 2 && place_.on_palm) || (k >= 6 && !thumb)) continue;
          moved = better(trial) || moved;
        }
      }
    }
    grasp_at(best_);
  }

  /// True of a body that no finger that closes moves: a pad that it carries is pressed by that finger.
  bool rests(int body) const {
    return std::ranges::none_of(closing_.chains(), [&](const FingerChain& chain) {
      return closing_.moves(chain) && std::ranges::find(chain.bodies, body) != chain.bodies.end();
    });
  }

  /// @param from where it does not touch the palm or its pads, or not so deep, along z. @param q angles.
  /// @param rigid without pads that closing fingers carry
  void put_on_palm(double from, const std::vector<double>& q, bool rigid) {
    const auto depth_at = [&](double z) {
      x_HO_.p.z() = z;
      hand_.place(x_HO_);
      const std::vector<double>& depths = hand_.depths(q, palm_);
      double most = 0;
      for (std::size_t body = 0; body < depths.size(); ++body)
        if (depths[body] > most && (!rigid || rests(static_cast<int>(body)))) most = depths[body];
      return most;
    };
    const double wanted = depth_[as_index(hand_.palm())];
    double z = from;
    while (depth_at(z) <= wanted && z < 0) z += kNearer;
    double low = z - kNearer, high = z;
    for (int n = 0; n < kHalvings; ++n) {
      const double middle = 0.5 * (low + high);
      (depth_at(middle) > wanted ? high : low) = middle;
    }
    depth_at(high);
  }

  /// The fingers and the palm that touch, and forces that balance.
  void compute_forces() {
    contacts_.clear();
    GripTask& balance_of = task_of_;
    balance_of = {};
    const auto& chains = closing_.chains();
    for (const FingerChain& chain : chains) {
      const double force = asked(chain.part);
      balance_of.asked.push_back(force > 0 ? std::optional(force) : std::nullopt);
    }
    balance_of.asked.push_back(std::nullopt);  // the palm
    std::vector<TouchPoint> touches = hand_.touches(q_);
    std::ranges::stable_sort(touches, {}, &TouchPoint::body);
    for (const TouchPoint& touch : touches) {
      std::size_t presser = chains.size();
      for (std::size_t i = 0; i < chains.size(); ++i)
        if (!touch.of_palm && std::ranges::find(chains[i].bodies, touch.body) != chains[i].bodies.end())
          presser = i;
      if (presser < chains.size() && !closing_.moves(chains[presser])) continue;
      contacts_.push_back(touch);
      const double friction = spec_.friction.value_or(touch.friction);
      balance_of.contacts.push_back({touch.point, touch.normal, kFrictionShare * friction, presser, friction,
                                     touch.friction > 0 ? touch.spinning * friction / touch.friction : 0});
    }
    share_parts();
    balance_of.load = place_.weight;
    balance_of.centre = x_HO_ * site_.object.body.centre;
    balance_of.size = 0.5 * model::box_edges(site_.object.shapes).minCoeff();
    balanced_ = balance(balance_of);
    for (std::size_t i = 0; i < contacts_.size(); ++i) contacts_[i].planned = normal_force(i);
  }

  /// Points of pads that stiffen share the force of their body as at these depths: a shallow one takes no
  /// part of it before a deep one has far more.
  void share_parts() {
    for (std::size_t first = 0, last = 0; first < contacts_.size(); first = ++last) {
      while (last + 1 < contacts_.size() && contacts_[last + 1].body == contacts_[first].body) ++last;
      if (!contacts_[first].pad || !contacts_[first].pad->law) continue;
      double sum = 0;
      for (std::size_t i = first; i <= last; ++i) sum += contacts_[i].push();
      for (std::size_t i = first; i <= last; ++i) {
        GripContact& contact = task_of_.contacts[i];
        contact.share = sum > 0 ? contacts_[i].push() / sum : 1 / static_cast<double>(last + 1 - first);
        contact.part = {first, last};
      }
    }
  }

  double normal_force(std::size_t i) const { return balanced_.forces[i].dot(contacts_[i].normal); }

  /// By body the planned normal force less that of the pads, as deep as they are pressed [N].
  std::vector<double> lacking() const {
    std::vector<double> out(depth_.size());
    for (const TouchPoint& contact : contacts_)
      if (contact.pad) out[as_index(contact.body)] += contact.planned - contact.push();
    return out;
  }

  /// Presses the pads nearer to the depths at which they have their forces.
  void press_deeper() {
    const Vec3 before = x_HO_.p;
    if (place_.on_palm) {
      double& depth = depth_[as_index(hand_.palm())];
      std::vector<TouchPoint> own;
      std::ranges::copy_if(contacts_, std::back_inserter(own), &TouchPoint::of_palm);
      const bool rigid = std::ranges::any_of(own, [&](const TouchPoint& touch) { return rests(touch.body); });
      if (rigid) std::erase_if(own, [&](const TouchPoint& touch) { return !rests(touch.body); });
      depth = std::max(kTouchDepth, depth + pad_move(own).deeper);
      put_on_palm(x_HO_.p.z() - 2 * kNearer, q_, rigid);
    }
    hand_.place(x_HO_);
    q_ = closing_.press(q_, contacts_, x_HO_.p - before);
  }

  void sum_forces() {
    out_.forces.clear();
    out_.palm_force = 0;
    for (std::size_t i = 0; i < contacts_.size(); ++i)
      (contacts_[i].of_palm ? out_.palm_force : out_.forces[hand_.part(contacts_[i].body)]) +=
          normal_force(i);
  }

  /// Share of what the contacts hold that weight and shake take.
  double use() const { return load_share(task_of_, balanced_, place_.loads); }

  bool balances() const { return balanced_.unbalanced <= kUnbalanced; }

  /// Presses more, or less; more only as long as the object stays between the pads.
  void press_with(double factor) {
    const double held = strength_;
    for (int n = 0; n < kRaises; ++n, factor = std::sqrt(factor)) {
      strength_ = factor * held;
      grasp_at(best_);
      if (balances()) return;
      slips_ = true;
    }
    strength_ = held;
    grasp_at(best_);
  }

  /// Raises forces that are too small for the object's weight and shake, and reduces those that the joints
  /// cannot press with. A problem if they then do not carry the object.
  void press_as_needed() {
    const double asked_strength = strength_;
    double wanted = strength_;
    for (int round = 0; round < kRaises && balances() && !slips_; ++round) {
      wanted = std::max(asked_strength, strength_ * spec_.reserve * use() / kUse);
      const double factor = std::min(wanted / strength_, 1 / (worst_torque().first + 1e-9));
      if (std::abs(factor - 1) < kEnough) break;
      press_with(factor);
    }
    const auto [share, axis] = worst_torque();
    if (share > 1) {
      for (Vec3& force : balanced_.forces) force /= share;
      sum_forces();
    }
    judge_forces(wanted / strength_, axis);
  }

  void judge_forces(double lacking, const std::string& axis) {
    const double used = use();
    const std::string limit =
        slips_ ? "more than which pushes it out of the grip" : "the torque limit of " + axis;
    if (used > kMostUse)
      weak_ = {task_.place, task_.path,
               fmt::format("a hand of {:.0f} mm that presses with {:.3g} N in sum, {}",
                           1e3 * site_.built.size.length, total_force(), limit),
               fmt::format("{:.3g} N for the object's weight and shake: a stronger hand, or a lighter object",
                           total_force() * used / kMostUse)};
    else if (lacking > 1 + 2 * kEnough)
      out_.warnings.push_back(fmt::format("{}: the hand presses with {:.3g} N in place of {:.3g} N: {}",
                                          task_.path, total_force(), total_force() * lacking, limit));
  }

  /// Largest torque over its limit, and the axis.
  std::pair<double, std::string> worst_torque() {
    const double strength = own_strength();
    const std::vector<double> tau = torques();
    std::pair<double, std::string> worst = {0, ""};
    for (std::size_t i = 0; i < tau.size(); ++i) {
      const control::HandAxis& axis = hand_.axes().axes[i];
      const auto gains = control::gains_of(site_.scene.control->controller, axis);
      if (!gains || !gains->torque_limit) continue;
      worst = std::max(worst, {std::abs(tau[i]) / (strength * *gains->torque_limit), axis.name()});
    }
    return worst;
  }

  double total_force() const {
    return std::accumulate(out_.forces.begin(), out_.forces.end(), out_.palm_force,
                           [](double sum, const auto& of) { return sum + of.second; });
  }

  void report() {
    std::string why;
    if (!opens_) why = "cannot open round it";
    for (const auto& [part, force] : spec_.forces)
      if (why.empty() && !out_.forces.contains(part))
        why = fmt::format("{} finger does not reach it", part_name(part));
    if (why.empty() && !balances())
      why = fmt::format("forces do not balance: {:.0f} % are left over", 100 * balanced_.unbalanced);
    if (why.empty() && unplanned() > kMostUnplanned) why = "it lies against a part that does not press";
    if (why.empty()) {
      if (weak_) out_.problems.push_back(*weak_);
      return;
    }
    const Vec3 edges = 1e3 * model::box_edges(site_.object.shapes);
    out_.problems.push_back({task_.place, task_.path,
                             fmt::format("a hand of {:.0f} mm, which opens to {:.0f} mm between thumb and "
                                         "fingers, on {} of {:.0f} x {:.0f} x {:.0f} mm: {}",
                                         1e3 * site_.built.size.length, 1e3 * opening(), site_.object.name,
                                         edges.x(), edges.y(), edges.z(), why),
                             balances() ? "a larger hand, or a smaller object"
                                        : "a larger hand, or a smaller or lighter object"});
  }

  /// Largest distance of the thumb's tip from another finger's that closes, with the fingers wide open [m].
  double opening() const {
    const model::State state = model::state_at(hand_.model(), closing_.angles_at(-kWideOpen));
    const auto tip = [&](const FingerChain& chain) { return state.bodies[as_index(chain.bodies.back())].p; };
    double most = 0;
    for (const FingerChain& thumb : closing_.chains())
      for (const FingerChain& chain : closing_.chains())
        if (thumb.part == model::Part::thumb && spec_.forces.contains(chain.part))
          most = std::max(most, (tip(chain) - tip(thumb)).norm());
    return most;
  }

  /// Torques of the contact forces about the axes, positive where the springs must flex [N m].
  std::vector<double> torques() {
    std::vector<double> out(q_.size());
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      const model::Jacobian J = hand_.jacobian(q_, contacts_[i].body, contacts_[i].point);
      for (std::size_t k = 0; k < out.size(); ++k)
        out[k] += balanced_.forces[i].dot(Vec3(J.col(static_cast<Eigen::Index>(k)).head<3>()));
    }
    return out;
  }

  /// Targets of the springs: theirs and those of the tissue, whose torque at the target is fed forward.
  std::vector<double> pressing() {
    std::vector<double> out = q_;
    const std::vector<double> tau = torques();
    const auto& axes = hand_.axes().axes;
    const bool fed = site_.scene.control->controller.tissue_compensation;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      const auto gains = control::gains_of(site_.scene.control->controller, axes[i]);
      if (!gains || gains->proportional.value_or(0) <= 0) continue;
      const auto& tissue = hand_.model().joints[axes[i].joint_index].axes[axes[i].axis_index].tissue;
      const double stiffness = *gains->proportional + (fed && tissue ? tissue->stiffness : 0);
      out[i] += tau[i] / stiffness;
    }
    return out;
  }

  control::PoseSpec pose(const std::vector<double>& angles) const {
    control::PoseSpec out;
    out.place = task_.place;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const control::HandAxis& axis = hand_.axes().axes[i];
      control::PoseAngles& of = out.joints[axis.joint];
      of.place = task_.place;
      of.angles.resize(std::max(of.angles.size(), axis.axis_index + 1));
      of.angles[axis.axis_index] = angles[i];
    }
    return out;
  }

  const TaskSite& site_;
  const GripSpec& spec_;
  const GripPlace& place_;
  const TaskSpec& task_;
  HandOnObject hand_;
  Closing closing_;
  std::size_t palm_;           ///< watched in hand_
  double strength_ = 1;        ///< factor on the forces
  Pose x_HO_;                  ///< of the object as far as it is pressed
  std::vector<double> depth_;  ///< to which each body presses
  std::vector<double> touch_, q_;
  std::vector<TouchPoint> contacts_;
  GripTask task_of_;
  GripForces balanced_;
  bool opens_ = true;
  bool slips_ = false;           ///< where the fingers press with more
  Place best_;                   ///< that was chosen
  std::optional<Problem> weak_;  ///< the forces are too small
  FittedGrip out_;
};

}  // namespace

FittedGrip fit_grip(const TaskSite& site, const GripSpec& spec, const GripPlace& place,
                    const TaskSpec& task) {
  return Fit(site, spec, place, task).run();
}

}  // namespace handsim::scene
