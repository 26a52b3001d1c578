#include "handsim/simulation/watch/contact_sums.h"

#include <algorithm>

#include "handsim/simulation/watch/hand_parts.h"
#include "handsim/simulation/watch/summary_json.h"

namespace handsim::simulation {

namespace {

/// Adds a contact of a step to a sum, the force taken with this sign.
void add(ContactSum& sum, const engine::Contact& contact, double sign) {
  ++sum.contacts;
  sum.force += sign * contact.force;
  sum.normal += contact.normal_force();
  sum.friction += contact.friction_force().norm();
}

template <class Sums>
void begin_step(Sums& sums) {
  for (auto& [key, sum] : sums) {
    sum.contacts = 0;
    sum.force.setZero();
    sum.normal = sum.friction = 0;
  }
}

template <class Sums>
void end_step(Sums& sums, double time, double step) {
  for (auto& [key, sum] : sums) {
    sum.normal_time += step * sum.normal;
    if (sum.normal > sum.largest_normal) sum.largest_normal = sum.normal, sum.largest_at = time;
  }
}

template <class Archive, class T>
void serialize_sum(Archive& archive, T& sum) {
  archive(sum.contacts, sum.force, sum.normal, sum.friction, sum.normal_time, sum.largest_normal,
          sum.largest_at);
}

}  // namespace

ContactSums::ContactSums(const Watched& watched) {
  const model::Model& model = watched.scene.model;
  const std::vector<std::optional<std::size_t>> objects = model.objects_of_shapes();
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const model::Shape& shape = model.shapes[i];
    const std::optional<std::size_t> part = hand_part(shape.part);
    // `right.index_distal` is of `right.index`.
    std::string name = objects[i] ? model.objects[*objects[i]].name : shape.name;
    if (part) name = shape.name.substr(0, shape.name.find('.') + 1) + kHandParts[*part];
    const auto found = std::ranges::find(things_, name);
    thing_.push_back(as_index(found - things_.begin()));
    if (found != things_.end()) continue;
    things_.push_back(name);
    is_finger_.push_back(part.has_value());
  }
}

void ContactSums::update(Step& step) {
  const double time = step.engine.state().time, length = step.engine.settings().step;
  begin_step(pairs_);
  begin_step(fingers_);
  for (const engine::Contact& contact : step.engine.contacts()) {
    const std::size_t a = thing_[as_index(contact.shape_a)];
    const std::size_t b = thing_[as_index(contact.shape_b)];
    add(pairs_[{std::min(a, b), std::max(a, b)}], contact, a <= b ? 1 : -1);
    if (is_finger_[a]) add(fingers_[a], contact, 1);
    if (is_finger_[b] && b != a) add(fingers_[b], contact, -1);
  }
  end_step(pairs_, time, length);
  end_step(fingers_, time, length);
  time_ += length;
}

std::vector<std::pair<ContactSums::Pair, ContactSum>> ContactSums::pairs() const {
  std::vector<std::pair<Pair, ContactSum>> out;
  for (const auto& [pair, sum] : pairs_) out.push_back({{things_[pair.first], things_[pair.second]}, sum});
  return out;
}

std::vector<std::pair<std::string, ContactSum>> ContactSums::fingers() const {
  std::vector<std::pair<std::string, ContactSum>> out;
  for (const auto& [finger, sum] : fingers_) out.emplace_back(things_[finger], sum);
  return out;
}

void ContactSums::save(ArchiveWriter& out) const {
  out(time_, pairs_.size());
  for (const auto& [things, sum] : pairs_) {
    out(things.first, things.second);
    serialize_sum(out, sum);
  }
  out(fingers_.size());
  for (const auto& [thing, sum] : fingers_) {
    out(thing);
    serialize_sum(out, sum);
  }
}

void ContactSums::restore(ArchiveReader& in, const model::State& /*state*/) {
  const auto thing = [&] {
    std::size_t index = 0;
    in(index);
    if (index >= things_.size()) in.refuse("a thing that is not there", "things of this scene");
    return index;
  };
  in(time_);
  pairs_.clear();
  for (std::size_t n = in.size(); n > 0; --n) {
    const std::size_t first = thing(), second = thing();
    serialize_sum(in, pairs_[{first, second}]);
  }
  fingers_.clear();
  for (std::size_t n = in.size(); n > 0; --n) serialize_sum(in, fingers_[thing()]);
}

/// Sums of the points' normal and friction forces, and their vector: on the finger; on the first of a pair.
void ContactSums::add_summary(SummaryJson& out) const {
  const auto add = [&](Json& to, Json entry, const ContactSum& sum) {
    entry["contacts_at_end"] = sum.contacts;
    entry["normal_force_at_end_N"] = sum.normal;
    entry["friction_force_at_end_N"] = sum.friction;
    entry["force_at_end_N"] = {sum.force.x(), sum.force.y(), sum.force.z()};
    entry["mean_normal_force_N"] = time_ > 0 ? sum.normal_time / time_ : 0.0;
    entry["largest_normal_force_N"] = sum.largest_normal;
    entry["largest_at_s"] = sum.largest_at;
    to.push_back(std::move(entry));
  };
  Json& forces = out.json["contact_forces"] = {{"fingers", Json::array()}, {"pairs", Json::array()}};
  for (const auto& [name, sum] : fingers()) add(forces["fingers"], {{"name", name}}, sum);
  for (const auto& [pair, sum] : pairs()) add(forces["pairs"], {{"a", pair.first}, {"b", pair.second}}, sum);
}

}  // namespace handsim::simulation
