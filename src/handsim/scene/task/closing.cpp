#include "handsim/scene/task/closing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "handsim/core/units.h"
#include "handsim/engine/collision/ode_library.h"
#include "handsim/scene/build/model_parts.h"

namespace handsim::scene {

namespace {

/// Step of the fastest joint on the way: with three joints a fingertip moves 6 mm, less than its thickness.
constexpr double kStep = 2 * kDegree;
constexpr int kBisections = 14;  ///< A fingertip is then within 0.4 um.
/// A finger that had to open wider opens by so much more.
constexpr double kSpare = 4 * kDegree;
constexpr int kApproachPlaces = 24;
constexpr double kFarthest = 3;  ///< A finger opens by at most so many times its way to the closed angles.
/// In the turn of a finger's joints as it is pressed: a turn of 1 rad counts as this error of its points [m];
/// a squared error along the surface as this share of one into it.
constexpr double kRidge = 3e-3, kSlideWeight = 0.2;
constexpr double kDeeper = 2e-3;  ///< Most that one presses a pad deeper at once [m].
constexpr int kSearchHalvings = 50;
constexpr double kSmallWay = 1e-6;  ///< Below it a chord is the slope [m].

/// The chains of a hand, in the order of its joints.
std::vector<FingerChain> finger_chains(HandOnObject& hand) {
  const model::Model& model = hand.model();
  std::vector<FingerChain> out;
  std::vector<std::size_t> chain_of(model.bodies.size());
  std::size_t last = model.joints.size();
  for (std::size_t i = 0; i < hand.axes().axes.size(); ++i) {
    const std::size_t index = hand.axes().axes[i].joint_index;
    const model::Joint& joint = model.joints[index];
    if (index != last) {
      if (joint.parent == hand.palm()) {
        chain_of[as_index(joint.child)] = out.size();
        out.push_back({hand.part(joint.child), {}, {}, 0});
      } else {
        chain_of[as_index(joint.child)] = chain_of[as_index(joint.parent)];
      }
      out[chain_of[as_index(joint.child)]].bodies.push_back(joint.child);
      last = index;
    }
    out[chain_of[as_index(joint.child)]].axes.push_back(i);
  }
  for (FingerChain& chain : out) chain.watched = hand.watch(chain.bodies);
  return out;
}

}  // namespace

Closing::Closing(HandOnObject& hand, std::vector<double> open, std::vector<double> closed)
    : hand_(hand),
      chains_(finger_chains(hand)),
      start_(std::move(open)),
      closed_(std::move(closed)),
      open_(start_) {}

double Closing::way(const FingerChain& chain) const {
  double most = 0;
  for (const std::size_t i : chain.axes) most = std::max(most, std::abs(closed_[i] - start_[i]));
  return most;
}

void Closing::oppose(double turn) {
  for (const FingerChain& chain : chains_)
    if (chain.part == model::Part::thumb)
      for (std::vector<double>* pose : {&start_, &closed_}) (*pose)[chain.axes.front()] += turn - opposed_;
  opposed_ = turn;
}

double Closing::angle(std::size_t axis, double share) const {
  const double angle = start_[axis] + share * (closed_[axis] - start_[axis]);
  const auto& stop = hand_.axes().axes[axis].stop;
  return stop ? std::clamp(angle, stop->low, stop->high) : angle;
}

std::vector<double> Closing::angles_at(double share) const {
  std::vector<double> out;
  for (std::size_t i = 0; i < start_.size(); ++i) out.push_back(angle(i, share));
  return out;
}

bool Closing::touches(const FingerChain& chain, const std::vector<double>& q) {
  const std::vector<double>& depths = hand_.depths(q, chain.watched);
  return std::ranges::any_of(chain.bodies, [&](int body) { return depths[as_index(body)] > 0; });
}

bool Closing::open_clear(const Pose& x_HO, const Vec3& from) {
  bool clear = true;
  open_ = angles_at(0);
  for (const FingerChain& chain : chains_) {
    const double fastest = way(chain);
    if (fastest == 0) continue;
    double share = 0;
    bool opened = false;
    for (int place = kApproachPlaces; place >= 0 && clear; --place) {
      hand_.place({x_HO.p - (static_cast<double>(place) / kApproachPlaces) * from, x_HO.q});
      while (clear && touches(chain, open_)) {
        opened = true;
        share -= kStep / fastest;
        for (const std::size_t i : chain.axes) open_[i] = angle(i, share);
        clear = share > -kFarthest;
      }
    }
    if (opened)
      for (const std::size_t i : chain.axes) open_[i] = angle(i, share - kSpare / fastest);
  }
  hand_.place(x_HO);
  return clear;
}

void Closing::close(const FingerChain& chain, const std::vector<double>& depth, std::vector<double>& q) {
  const double fastest = way(chain);
  if (fastest == 0) return;
  std::size_t held = 0;  // axes that stand
  std::size_t part = 0;  // bodies that are not tested any more
  const auto joint_of = [&](std::size_t axis) { return hand_.axes().axes[axis].joint_index; };
  const auto go = [&](double share) {
    for (std::size_t i = held; i < chain.axes.size(); ++i) q[chain.axes[i]] = angle(chain.axes[i], share);
  };
  // The outermost of the bodies left that presses as deep as it shall.
  const auto touching = [&]() -> std::optional<std::size_t> {
    const std::vector<double>& depths = hand_.depths(q, chain.watched);
    for (std::size_t k = chain.bodies.size(); k-- > part;) {
      const auto body = as_index(chain.bodies[k]);
      if (depths[body] > depth[body]) return k;
    }
    return std::nullopt;
  };
  double share = -kSpare / fastest;
  for (const std::size_t i : chain.axes)  // from where the finger is open
    if (std::abs(closed_[i] - start_[i]) > 1e-9)
      share = std::min(share, (open_[i] - start_[i]) / (closed_[i] - start_[i]));
  go(share);
  while (part < chain.bodies.size()) {
    const double before = share;
    auto found = touching();
    if (!found) {
      if (share >= 1) return;
      share = std::min(1.0, share + kStep / fastest);
      go(share);
      found = touching();
      if (!found) continue;
      double low = before, high = share;
      for (int n = 0; n < kBisections; ++n) {
        share = 0.5 * (low + high);
        go(share);
        (touching() ? high : low) = share;
      }
      share = high;
      go(share);
      found = touching();
    }
    part = found.value_or(part) + 1;
    // The joints up to that of the body that touches stand.
    while (held < chain.axes.size() &&
           hand_.model().joints[joint_of(chain.axes[held])].child != chain.bodies[part - 1])
      ++held;
    while (held < chain.axes.size() &&
           hand_.model().joints[joint_of(chain.axes[held])].child == chain.bodies[part - 1])
      ++held;
  }
}

std::vector<double> Closing::close(const std::vector<double>& depth) {
  std::vector<double> q = open_;
  for (const FingerChain& chain : chains_) close(chain, depth, q);
  return q;
}

void Closing::press(const FingerChain& chain, const std::vector<TouchPoint>& contacts, const Vec3& moved,
                    const std::vector<double>& from, std::vector<double>& q) {
  // By body, how much deeper it goes, and the stiffness of its pads on that way: what an error of the depth
  // costs. A pad of the palm that a segment carries is a part of its own.
  std::vector<std::array<PadMove, 2>> moves(chain.bodies.size());
  double stiffest = 0;
  for (std::size_t k = 0; k < moves.size(); ++k)
    for (const bool of_palm : {false, true}) {
      std::vector<TouchPoint> own;
      std::ranges::copy_if(contacts, std::back_inserter(own), [&](const TouchPoint& contact) {
        return contact.body == chain.bodies[k] && contact.of_palm == of_palm;
      });
      moves[k][of_palm] = pad_move(own);
      stiffest = std::max(stiffest, moves[k][of_palm].stiffness);
    }
  const auto n = static_cast<Eigen::Index>(chain.axes.size());
  Eigen::MatrixXd a = kRidge * kRidge * Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(n);
  for (const TouchPoint& contact : contacts) {
    const auto body = std::ranges::find(chain.bodies, contact.body) - chain.bodies.begin();
    if (as_index(body) == chain.bodies.size()) continue;
    const PadMove& move = moves[as_index(body)][contact.of_palm];
    const Eigen::MatrixXd rows =
        hand_.jacobian(from, contact.body, contact.point)(Eigen::seqN(0, 3), chain.axes);
    const Mat3 into = contact.normal * contact.normal.transpose();
    const Mat3 weight = (move.stiffness > 0 ? move.stiffness / stiffest : 1) *
                        (into + kSlideWeight * (Mat3::Identity() - into));
    a += rows.transpose() * weight * rows;
    b += rows.transpose() * weight * (moved + move.deeper * contact.normal);
  }
  const Eigen::VectorXd turn = a.ldlt().solve(b);
  for (Eigen::Index k = 0; k < n; ++k) {
    const std::size_t axis = chain.axes[as_index(k)];
    q[axis] += turn[k];
    if (const auto& stop = hand_.axes().axes[axis].stop) q[axis] = std::clamp(q[axis], stop->low, stop->high);
  }
}

std::vector<double> Closing::press(const std::vector<double>& q, const std::vector<TouchPoint>& contacts,
                                   const Vec3& moved) {
  std::vector<double> out = q;
  for (const FingerChain& chain : chains_)
    if (moves(chain)) press(chain, contacts, moved, q, out);
  return out;
}

HandOnObject::HandOnObject(const TaskSite& site) : model_(model::make_model()) {
  engine::enter_ode();
  hand::Placement placement;
  placement.name = site.entry.placement.name;
  ContactGroups groups;
  groups.add_hand(placement.name, hand::add_hand(model_, site.built, placement));
  const int group = model_.add_group("objects");
  groups.add({group, ContactGroups::Owner::object}, {"objects", site.object.name});
  // It is placed anywhere, also one that does not move.
  ObjectSpec object = site.object;
  if (object.is_static) object.body = {1, object.body.centre, Mat3::Identity()};
  object.is_static = false;
  object_ = add_object(model_, object, group);
  body_frame_ = object.body_frame();
  // Whatever effects are on.
  model::Effects touch;
  touch.add(model::Effect::object_contact);
  add_contact_rules(model_, site.scene.contacts, groups, touch, nullptr);
  axes_ = control::hand_axes(model_, model_.hands.front());
  parts_.assign(model_.bodies.size(), model::Part::palm);
  for (auto shape = model_.shapes.rbegin(); shape != model_.shapes.rend(); ++shape)
    parts_[as_index(shape->body)] = shape->part;
  collider_ = std::make_unique<engine::Collider>(model_, model::Effects{}, false);
  q_.assign(as_index(model_.dof_count()), 0.0);
  state_ = model::state_at(model_, q_);
}

/// Moves the bodies beyond joints whose angles have changed, and the object.
void HandOnObject::move(std::span<const double> q) {
  moved_.assign(model_.bodies.size(), false);
  for (const model::Joint& joint : model_.joints) {
    const auto first = q.begin() + joint.first_dof, end = first + model::dof_count(joint.kind);
    const bool moves =
        moved_[as_index(joint.parent)] || !std::equal(first, end, q_.begin() + joint.first_dof);
    moved_[as_index(joint.child)] = moves;
    if (!moves) continue;
    const Pose pose = state_.bodies[as_index(joint.parent)].pose() * joint.parent_frame *
                      model::joint_transform(joint, {first, end}) * joint.child_frame.inverse();
    state_.bodies[as_index(joint.child)].p = pose.p;
    state_.bodies[as_index(joint.child)].q = pose.q;
  }
  q_.assign(q.begin(), q.end());
  model::BodyState& object = state_.bodies[as_index(object_)];
  const Pose x_HB = x_HO_ * body_frame_;
  object.p = x_HB.p;
  object.q = x_HB.q;
}

const std::vector<TouchPoint>& HandOnObject::touches(std::span<const double> q) {
  move(q);
  collider_->collide(state_, {});
  touches_.clear();
  for (const engine::Touch& touch : collider_->touches())
    for (std::size_t i = touch.first; i < touch.first + as_index(touch.count); ++i) {
      const engine::Contact& contact = collider_->contacts()[i];
      const int a = model_.shapes[as_index(contact.shape_a)].body;
      const int b = model_.shapes[as_index(contact.shape_b)].body;
      const bool hand_is_a = b == object_;
      const double share = collider_->shares()[i];
      TouchPoint& point = touches_.emplace_back();
      point.body = hand_is_a ? a : b;
      point.point = contact.position;
      point.normal = hand_is_a ? Vec3(-contact.normal) : contact.normal;
      point.depth = contact.depth;
      point.friction = touch.surface.friction;
      point.spinning = collider_->spinning(touch, i);
      point.share = share;
      point.pad = touch.surface.compliance;
      const int shape = hand_is_a ? contact.shape_a : contact.shape_b;
      point.of_palm = model_.shapes[as_index(shape)].part == model::Part::palm;
    }
  return touches_;
}

double TouchPoint::push(double deeper) const {
  if (!pad) return 0;
  return pad->law ? share * pad->lasting() * pad->elastic(depth + deeper).force
                  : share * pad->stiffness * (depth + deeper);
}

PadMove pad_move(std::span<const TouchPoint> of_part) {
  PadMove out;
  const model::Compliance* pad = nullptr;
  double lacks = 0, shares = 0, stiffness = 0;
  for (const TouchPoint& contact : of_part) {
    if (!contact.pad) continue;
    pad = &*contact.pad;
    lacks += contact.planned - contact.push();
    shares += contact.share;
    stiffness += contact.share * pad->stiffness;
  }
  if (!pad) return out;
  if (!pad->law) return {std::clamp(lacks / stiffness, -kDeeper, kDeeper), pad->stiffness};
  const auto gain = [&](double deeper) {
    double sum = 0;
    for (const TouchPoint& contact : of_part) sum += contact.push(deeper) - contact.push();
    return sum;
  };
  double low = -kDeeper, high = kDeeper;
  for (int n = 0; n < kSearchHalvings; ++n) {
    out.deeper = 0.5 * (low + high);
    (gain(out.deeper) > lacks ? high : low) = out.deeper;
  }
  const double way = std::abs(out.deeper) > kSmallWay ? out.deeper : kSmallWay;
  out.stiffness = gain(way) / (way * shares);
  return out;
}

template <class Watches>
std::size_t HandOnObject::watch_shapes(Watches watches) {
  auto watched = std::make_unique<Watched>();
  watched->model = model_;
  std::erase_if(watched->model.shapes,
                [&](const model::Shape& shape) { return shape.body != object_ && !watches(shape); });
  watched->collider = std::make_unique<engine::Collider>(watched->model, model::Effects{}, false);
  watched_.push_back(std::move(watched));
  return watched_.size() - 1;
}

std::size_t HandOnObject::watch(std::span<const int> bodies) {
  return watch_shapes([&](const model::Shape& shape) {
    return shape.part != model::Part::palm && std::ranges::find(bodies, shape.body) != bodies.end();
  });
}

std::size_t HandOnObject::watch_palm() {
  return watch_shapes(
      [&](const model::Shape& shape) { return shape.body == palm() || shape.part == model::Part::palm; });
}

const std::vector<double>& HandOnObject::depths(std::span<const double> q, std::size_t watched) {
  move(q);
  Watched& of = *watched_[watched];
  of.collider->collide(state_, {});
  depths_.assign(model_.bodies.size(), 0);
  for (const engine::Contact& contact : of.collider->contacts())
    for (const int shape : {contact.shape_a, contact.shape_b}) {
      double& depth = depths_[as_index(of.model.shapes[as_index(shape)].body)];
      depth = std::max(depth, contact.depth);
    }
  return depths_;
}

model::Jacobian HandOnObject::jacobian(std::span<const double> q, int body, const Vec3& point) {
  move(q);
  return model::jacobian(model_, state_, body, point);
}

}  // namespace handsim::scene
