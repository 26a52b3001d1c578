#include "handsim/environment/observation.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/index.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::environment {

namespace {

constexpr std::array<std::string_view, 16> kParts = {"time",
                                                     "q",
                                                     "u",
                                                     "tau",
                                                     "wrists",
                                                     "fingertips",
                                                     "objects",
                                                     "finger_contacts",
                                                     "contact_pairs",
                                                     "excitation",
                                                     "activation",
                                                     "fibre_length",
                                                     "fibre_speed",
                                                     "tendon_length",
                                                     "tendon_force",
                                                     "failed"};
constexpr std::array kPoseColumns = {".x[m]", ".y[m]", ".z[m]", ".qw", ".qx", ".qy", ".qz"};
constexpr std::array kRateColumns = {".vx[m/s]",   ".vy[m/s]",   ".vz[m/s]",
                                     ".wx[rad/s]", ".wy[rad/s]", ".wz[rad/s]"};
constexpr std::array kFingerColumns = {".fx[N]", ".fy[N]", ".fz[N]", ".points"};
constexpr std::array kPairColumns = {".normal[N]", ".points"};

bool failed(const simulation::Simulation& simulation) {
  const std::vector<simulation::Verdict> verdicts = simulation.verdicts();
  return std::any_of(verdicts.begin(), verdicts.end(), [](const auto& each) { return each.failed(); });
}

double* put(double* out, const Vec3& v) { return std::copy(v.data(), v.data() + 3, out); }
double* put(double* out, const Pose& pose) {
  out = put(out, pose.p);
  for (const double part : {pose.q.w(), pose.q.x(), pose.q.y(), pose.q.z()}) *out++ = part;
  return out;
}

template <class Names>
void add_columns(std::vector<std::string>& to, const std::string& of, const Names& names) {
  for (const char* name : names) to.push_back(of + name);
}

}  // namespace

std::span<const std::string_view> observation_parts() { return kParts; }

Observation::Observation(const scene::Scene& scene, std::span<const std::string> names) : scene_(scene) {
  std::vector<Problem> problems;
  for (const std::string& name : names)
    if (std::find(kParts.begin(), kParts.end(), name) == kParts.end())
      problems.push_back({std::nullopt, "observe", name, fmt::format("one of {}", fmt::join(kParts, ", "))});
  if (!problems.empty()) throw Error(std::move(problems));
  find_things();
  const std::vector<std::string> coordinates = output::coordinate_names(scene.model);
  for (const std::string& name : names) add(name, coordinates);
}

void Observation::find_things() {
  const model::Model& model = scene_.model;
  hand_part_.assign(model.shapes.size(), -1);
  other_.assign(model.shapes.size(), -1);
  std::vector<int> hand_of(model.bodies.size(), -1);
  for (std::size_t h = 0; h < model.hands.size(); ++h) {
    for (const int body : model.hands[h].bodies) hand_of[at(body)] = static_cast<int>(h);
    for (const char* part : simulation::kHandParts) hand_parts_.push_back(model.hands[h].name + "." + part);
    for (const model::Fingertip& tip : model.hands[h].fingertips) tips_.push_back(&tip);
  }
  for (const model::ObjectIndex& object : model.objects) {
    others_.push_back(object.name);
    if (object.body) objects_.push_back(*object.body);
  }
  others_.emplace_back("other");
  const std::vector<std::optional<std::size_t>> object_of = model.objects_of_shapes();
  for (std::size_t i = 0; i < model.shapes.size(); ++i) {
    const model::Shape& shape = model.shapes[i];
    const int part = simulation::hand_part(shape.part), hand = hand_of[at(shape.body)];
    if (part >= 0 && hand >= 0)
      hand_part_[i] = hand * static_cast<int>(simulation::kHandParts.size()) + part;
    else
      other_[i] = static_cast<int>(object_of[i].value_or(model.objects.size()));
  }
}

void Observation::add(const std::string& name, const std::vector<std::string>& coordinates) {
  const model::Model& model = scene_.model;
  const auto kind = static_cast<Kind>(std::find(kParts.begin(), kParts.end(), name) - kParts.begin());
  std::vector<std::string> columns;
  const auto of_coordinates = [&](const char* what) {
    for (const std::string& coordinate : coordinates) columns.push_back(coordinate + what);
  };
  const auto of_body = [&](const std::string& body) {
    add_columns(columns, body, kPoseColumns);
    add_columns(columns, body, kRateColumns);
  };
  const auto of_muscles = [&](const std::string& what) {
    if (model.muscles.empty())
      throw input_error("observe", name + " in a scene without muscles", "muscles among the effects");
    for (const model::Muscle& muscle : model.muscles) columns.push_back(muscle.name + what);
  };
  switch (kind) {
    case Kind::time:
      columns = {"time[s]"};
      break;
    case Kind::q:
      of_coordinates("");
      break;
    case Kind::u:
      of_coordinates(".rate");
      break;
    case Kind::tau:
      of_coordinates(".torque");
      break;
    case Kind::wrists:
      for (const model::HandIndex& hand : model.hands) of_body(hand.name + ".wrist");
      break;
    case Kind::fingertips:
      for (const model::Fingertip* tip : tips_)
        add_columns(columns, model.bodies[at(tip->body)].name + ".tip", kPoseColumns);
      break;
    case Kind::objects:
      for (const int body : objects_) of_body(model.bodies[at(body)].name);
      break;
    case Kind::finger_contacts:
      for (const std::string& part : hand_parts_) add_columns(columns, part, kFingerColumns);
      break;
    case Kind::contact_pairs:
      for (const std::string& part : hand_parts_)
        for (const std::string& other : others_) add_columns(columns, part + "-" + other, kPairColumns);
      break;
    case Kind::excitation:
    case Kind::activation:
      of_muscles("." + name);
      break;
    case Kind::fibre_length:
    case Kind::tendon_length:
      of_muscles("." + name + "[m]");
      break;
    case Kind::fibre_speed:
      of_muscles(".fibre_speed[m/s]");
      break;
    case Kind::tendon_force:
      of_muscles(".tendon_force[N]");
      break;
    case Kind::failed:
      columns = {"failed"};
      break;
  }
  kinds_.push_back(kind);
  parts_.push_back({name, size_, std::move(columns)});
  size_ += parts_.back().columns.size();
}

bool Observation::has(Kind kind) const {
  return std::find(kinds_.begin(), kinds_.end(), kind) != kinds_.end();
}

bool Observation::needs_forces() const { return has(Kind::finger_contacts) || has(Kind::contact_pairs); }

void Observation::write_contacts(std::span<const engine::Contact> contacts, std::span<double> by_finger,
                                 std::span<double> by_pair) const {
  std::fill(by_finger.begin(), by_finger.end(), 0);
  std::fill(by_pair.begin(), by_pair.end(), 0);
  const auto one = [&](int shape, int against, const engine::Contact& contact, double sign) {
    const int part = hand_part_[at(shape)];
    if (part < 0) return;
    if (!by_finger.empty()) {
      double* out = by_finger.data() + at(part) * kFingerColumns.size();
      for (int i = 0; i < 3; ++i) out[i] += sign * contact.force[i];
      out[3] += 1;
    }
    const int other = other_[at(against)] < 0 ? static_cast<int>(others_.size()) - 1 : other_[at(against)];
    if (by_pair.empty()) return;
    double* out = by_pair.data() + (at(part) * others_.size() + at(other)) * kPairColumns.size();
    out[0] += contact.normal_force();
    out[1] += 1;
  };
  for (const engine::Contact& contact : contacts) {
    one(contact.shape_a, contact.shape_b, contact, 1);
    one(contact.shape_b, contact.shape_a, contact, -1);
  }
}

void Observation::write(const simulation::Simulation& simulation, std::span<double> out) const {
  const model::State& state = simulation.state();
  std::span<double> by_finger, by_pair;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const std::span<double> to = out.subspan(parts_[i].first, parts_[i].columns.size());
    switch (kinds_[i]) {
      case Kind::time:
        to[0] = state.time;
        break;
      case Kind::q:
        std::copy(state.q.begin(), state.q.end(), to.begin());
        break;
      case Kind::u:
        std::copy(state.u.begin(), state.u.end(), to.begin());
        break;
      case Kind::tau:
        std::copy(state.tau.begin(), state.tau.end(), to.begin());
        break;
      case Kind::wrists:
      case Kind::fingertips:
      case Kind::objects:
        write_poses(kinds_[i], state, to.data());
        break;
      case Kind::finger_contacts:
        by_finger = to;
        break;
      case Kind::contact_pairs:
        by_pair = to;
        break;
      case Kind::failed:
        to[0] = failed(simulation) ? 1 : 0;
        break;
      default:
        write_muscles(kinds_[i], simulation, to);
    }
  }
  if (!by_finger.empty() || !by_pair.empty())
    write_contacts(simulation.engine().contacts(), by_finger, by_pair);
}

void Observation::write_muscles(Kind kind, const simulation::Simulation& simulation,
                                std::span<double> to) const {
  const model::State& state = simulation.state();
  const auto copy = [&](std::span<const double> from) { std::copy(from.begin(), from.end(), to.begin()); };
  switch (kind) {
    case Kind::excitation:
      // None has been given before the first step.
      if (simulation.excitations().empty()) std::fill(to.begin(), to.end(), 0);
      return copy(simulation.excitations());
    case Kind::activation:
      return copy(state.activation);
    case Kind::fibre_length:
      return copy(state.fibre_length);
    case Kind::fibre_speed:
      return copy(state.fibre_speed);
    case Kind::tendon_force:
      return copy(state.tendon_force);
    default:
      for (std::size_t i = 0; i < to.size(); ++i) {
        const model::Muscle& muscle = scene_.model.muscles[i];
        const double excursion = model::path_state(muscle.path, state.q).excursion;
        to[i] = model::tendon_length(muscle, excursion, state.fibre_length[i]);
      }
  }
}

void Observation::write_poses(Kind kind, const model::State& state, double* to) const {
  if (kind == Kind::wrists)
    for (const model::HandIndex& hand : scene_.model.hands) {
      const model::BodyState& palm = state.bodies[at(hand.palm)];
      const Pose wrist = palm.pose() * hand.wrist_frame;
      to = put(put(put(to, wrist), Vec3(palm.v + palm.w.cross(wrist.p - palm.p))), palm.w);
    }
  if (kind == Kind::fingertips)
    for (const model::Fingertip* tip : tips_) {
      const Pose body = state.bodies[at(tip->body)].pose();
      to = put(to, Pose{body * tip->point, body.q});
    }
  if (kind == Kind::objects)
    for (const int body : objects_) {
      const model::BodyState& of = state.bodies[at(body)];
      to = put(put(put(to, of.pose()), of.v), of.w);
    }
}

}  // namespace handsim::environment
