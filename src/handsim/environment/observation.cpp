#include "handsim/environment/observation.h"

#include <algorithm>
#include <array>
#include <functional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/model/muscle_curves.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/watch/hand_parts.h"

namespace handsim::environment {

namespace {

constexpr std::array kPoseColumns = {".x[m]", ".y[m]", ".z[m]", ".qw", ".qx", ".qy", ".qz"};
constexpr std::array kRateColumns = {".vx[m/s]",   ".vy[m/s]",   ".vz[m/s]",
                                     ".wx[rad/s]", ".wy[rad/s]", ".wz[rad/s]"};
constexpr std::array kFingerColumns = {".fx[N]", ".fy[N]", ".fz[N]", ".points"};
constexpr double kTaxelSpacing = 5e-3;  ///< [m]
constexpr std::array kPairColumns = {".normal[N]", ".points"};

bool failed(const simulation::Simulation& simulation) {
  const std::vector<simulation::Verdict> verdicts = simulation.verdicts();
  return std::ranges::any_of(verdicts, [](const auto& each) { return each.failed(); });
}

double* put(double* out, const Vec3& v) { return std::copy(v.data(), v.data() + 3, out); }
double* put(double* out, const Pose& pose) {
  out = put(out, pose.p);
  for (const double part : {pose.q.w(), pose.q.x(), pose.q.y(), pose.q.z()}) *out++ = part;
  return out;
}

using Columns = std::vector<std::string>;
using Simulation = simulation::Simulation;

/// Columns of a list of things: a thing's name with each of the endings in `parts`, thing by thing.
template <class Things, class Name>
Columns columns_of(const Things& things, Name name,
                   std::initializer_list<std::span<const char* const>> parts) {
  Columns out;
  for (const auto& thing : things)
    for (const auto& names : parts)
      for (const char* each : names) out.push_back(name(thing) + each);
  return out;
}

Columns coordinate_columns(const model::Model& model, const char* what) {
  Columns out = output::coordinate_names(model);
  for (std::string& name : out) name += what;
  return out;
}

Columns muscle_columns(const model::Model& model, const std::string& part, const char* unit) {
  if (model.muscles.empty())
    throw input_error("observe", part + " in a scene without muscles", "muscles among the effects");
  Columns out;
  for (const model::Muscle& muscle : model.muscles) out.push_back(muscle.name + "." + part + unit);
  return out;
}

/// Writes numbers of the state as they are.
template <auto kMember>
void copy_state(const Observation&, const Simulation& run, std::span<double> to) {
  std::ranges::copy(run.state().*kMember, to.begin());
}

}  // namespace

struct Observation::Kind {
  std::string_view name;
  Columns (*columns)(const Observation& of);
  void (*write)(const Observation& of, const Simulation& simulation, std::span<double> to);
};

std::span<const Observation::Kind> Observation::kinds() {
  using Values = std::span<double>;
  static const Kind kAll[] = {
      {"time", [](auto&) { return Columns{"time[s]"}; },
       [](auto&, auto& run, Values to) { to[0] = run.state().time; }},
      {"q", [](auto& of) { return coordinate_columns(of.scene_.model, ""); }, copy_state<&model::State::q>},
      {"u", [](auto& of) { return coordinate_columns(of.scene_.model, ".rate"); },
       copy_state<&model::State::u>},
      {"tau", [](auto& of) { return coordinate_columns(of.scene_.model, ".torque"); },
       copy_state<&model::State::tau>},
      {"wrists",
       [](auto& of) {
         return columns_of(of.scene_.model.hands, [](auto& hand) { return hand.name + ".wrist"; },
                           {kPoseColumns, kRateColumns});
       },
       [](auto& of, auto& run, Values to) {
         double* next = to.data();
         for (const model::HandIndex& hand : of.scene_.model.hands) {
           const model::BodyState& palm = run.state().bodies[as_index(hand.palm)];
           const Pose wrist = palm.pose() * hand.wrist_frame;
           next = put(put(put(next, wrist), Vec3(palm.v + palm.w.cross(wrist.p - palm.p))), palm.w);
         }
       }},
      {"fingertips",
       [](auto& of) {
         return columns_of(
             of.tips_, [&](auto* tip) { return of.scene_.model.bodies[as_index(tip->body)].name + ".tip"; },
             {kPoseColumns});
       },
       [](auto& of, auto& run, Values to) {
         double* next = to.data();
         for (const model::Fingertip* tip : of.tips_) {
           const Pose body = run.state().bodies[as_index(tip->body)].pose();
           next = put(next, Pose{body * tip->point, body.q});
         }
       }},
      {"objects",
       [](auto& of) {
         return columns_of(of.objects_, [&](int body) { return of.scene_.model.bodies[as_index(body)].name; },
                           {kPoseColumns, kRateColumns});
       },
       [](auto& of, auto& run, Values to) {
         double* next = to.data();
         for (const int index : of.objects_) {
           const model::BodyState& body = run.state().bodies[as_index(index)];
           next = put(put(put(next, body.pose()), body.v), body.w);
         }
       }},
      {"finger_contacts",
       [](auto& of) { return columns_of(of.hand_parts_, std::identity(), {kFingerColumns}); },
       [](auto& of, auto& run, Values to) { of.write_contacts(run.engine().contacts(), to, {}); }},
      {"taxels",
       [](auto& of) {
         Columns out;
         for (const engine::Taxels::Pad& pad : of.taxels_->pads())
           for (std::size_t k = 0; k < pad.count; ++k)
             out.push_back(fmt::format("{}.taxel{}[N]", pad.name, k));
         return out;
       },
       [](auto& of, auto& run, Values to) {
         std::ranges::copy(of.taxels_->read(run.engine().contacts(), run.state()), to.begin());
       }},
      {"contact_pairs",
       [](auto& of) {
         Columns pairs;
         for (const std::string& part : of.hand_parts_)
           for (const std::string& other : of.others_) pairs.push_back(part + "-" + other);
         return columns_of(pairs, std::identity(), {kPairColumns});
       },
       [](auto& of, auto& run, Values to) { of.write_contacts(run.engine().contacts(), {}, to); }},
      {"excitation", [](auto& of) { return muscle_columns(of.scene_.model, "excitation", ""); },
       [](auto&, auto& run, Values to) {
         // None has been given before the first step.
         if (run.excitations().empty()) std::ranges::fill(to, 0);
         std::ranges::copy(run.excitations(), to.begin());
       }},
      {"activation", [](auto& of) { return muscle_columns(of.scene_.model, "activation", ""); },
       copy_state<&model::State::activation>},
      {"fibre_length", [](auto& of) { return muscle_columns(of.scene_.model, "fibre_length", "[m]"); },
       copy_state<&model::State::fibre_length>},
      {"fibre_speed", [](auto& of) { return muscle_columns(of.scene_.model, "fibre_speed", "[m/s]"); },
       copy_state<&model::State::fibre_speed>},
      {"tendon_length", [](auto& of) { return muscle_columns(of.scene_.model, "tendon_length", "[m]"); },
       [](auto& of, auto& run, Values to) {
         for (std::size_t i = 0; i < to.size(); ++i) {
           const model::Muscle& muscle = of.scene_.model.muscles[i];
           const double excursion = model::path_state(muscle.path, run.state().q).excursion;
           to[i] = model::tendon_length(muscle, excursion, run.state().fibre_length[i]);
         }
       }},
      {"tendon_force", [](auto& of) { return muscle_columns(of.scene_.model, "tendon_force", "[N]"); },
       copy_state<&model::State::tendon_force>},
      {"failed", [](auto&) { return Columns{"failed"}; },
       [](auto&, auto& run, Values to) { to[0] = failed(run) ? 1 : 0; }}};
  return kAll;
}

Observation::Observation(const scene::Scene& scene, std::span<const std::string> names) : scene_(scene) {
  std::vector<std::string_view> known;
  for (const Kind& kind : kinds()) known.push_back(kind.name);
  std::vector<Problem> problems;
  for (const std::string& name : names)
    if (std::ranges::find(known, name) == known.end())
      problems.push_back({std::nullopt, "observe", name, fmt::format("one of {}", fmt::join(known, ", "))});
  if (!problems.empty()) throw Error(std::move(problems));
  collect_things();
  if (std::ranges::find(names, "taxels") != names.end()) taxels_.emplace(scene.model, kTaxelSpacing);
  for (const std::string& name : names) {
    const Kind& kind = *std::ranges::find_if(kinds(), [&](auto& each) { return each.name == name; });
    kinds_.push_back(&kind);
    parts_.push_back({name, size_, kind.columns(*this)});
    size_ += parts_.back().columns.size();
  }
}

void Observation::collect_things() {
  const model::Model& model = scene_.model;
  hand_part_.resize(model.shapes.size());
  other_.assign(model.shapes.size(), model.objects.size());
  std::vector<std::optional<std::size_t>> hand_of(model.bodies.size());
  for (std::size_t h = 0; h < model.hands.size(); ++h) {
    for (const int body : model.hands[h].bodies) hand_of[as_index(body)] = h;
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
    const auto part = simulation::hand_part(shape.part), hand = hand_of[as_index(shape.body)];
    if (part && hand)
      hand_part_[i] = *hand * simulation::kHandParts.size() + *part;
    else if (object_of[i])
      other_[i] = *object_of[i];
  }
}

bool Observation::has(std::string_view part) const {
  return std::ranges::any_of(parts_, [&](const ObservedPart& each) { return each.name == part; });
}

void Observation::write_contacts(std::span<const engine::Contact> contacts, std::span<double> by_finger,
                                 std::span<double> by_pair) const {
  std::ranges::fill(by_finger, 0);
  std::ranges::fill(by_pair, 0);
  const auto one = [&](int shape, int against, const engine::Contact& contact, double sign) {
    const std::optional<std::size_t> part = hand_part_[as_index(shape)];
    if (!part) return;
    if (!by_finger.empty()) {
      double* out = by_finger.data() + *part * kFingerColumns.size();
      for (int i = 0; i < 3; ++i) out[i] += sign * contact.force[i];
      out[3] += 1;
    }
    if (by_pair.empty()) return;
    double* out = by_pair.data() + (*part * others_.size() + other_[as_index(against)]) * kPairColumns.size();
    out[0] += contact.normal_force();
    out[1] += 1;
  };
  for (const engine::Contact& contact : contacts) {
    one(contact.shape_a, contact.shape_b, contact, 1);
    one(contact.shape_b, contact.shape_a, contact, -1);
  }
}

void Observation::write(const Simulation& simulation, std::span<double> out) const {
  for (std::size_t i = 0; i < parts_.size(); ++i)
    kinds_[i]->write(*this, simulation, out.subspan(parts_[i].first, parts_[i].columns.size()));
}

}  // namespace handsim::environment
