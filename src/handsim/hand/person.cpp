#include "handsim/hand/person.h"

#include <tuple>

#include <fmt/format.h>

namespace handsim::hand {

namespace {

const std::vector<std::pair<std::string_view, Sex>> kSexes = {
    {"male", Sex::male}, {"female", Sex::female}, {"unknown", Sex::unknown}};

auto measures(const Person& person) {
  return std::tie(person.stature, person.mass, person.sex, person.hand_length, person.hand_breadth,
                  person.hand_circumference, person.hand_mass, person.grip_strength, person.age, person.bones,
                  person.radii, person.fingers, person.hand_length_percentile, person.deviations);
}

/// Refuses impossible proportions of mass, hand and stature.
void check_body(MapReader& reader, const Person& person) {
  const double index = person.mass / (person.stature * person.stature);
  if (!(index >= 5 && index <= 150))
    reader.problem("mass", fmt::format("{:g} kg at {:g} m, {:.3g} kg/m2", person.mass, person.stature, index),
                   "a body mass index of 5 to 150 kg/m2");
  if (person.hand_mass && *person.hand_mass > 0.05 * person.mass)
    reader.problem("hand_mass", fmt::format("{:g} kg of a body of {:g} kg", *person.hand_mass, person.mass),
                   "at most 5 % of the body");
  if (person.hand_length && *person.hand_length > 0.25 * person.stature)
    reader.problem("hand_length",
                   fmt::format("{:g} m of a stature of {:g} m", *person.hand_length, person.stature),
                   "at most a quarter of the stature");
}

}  // namespace

std::string_view name(Sex sex) {
  for (const auto& entry : kSexes)
    if (entry.second == sex) return entry.first;
  return {};
}

double Person::deviation(std::string_view of) const {
  const auto found = deviations.find(std::string(of));
  return found == deviations.end() ? 0 : found->second;
}

bool same_body(const Person& a, const Person& b) { return measures(a) == measures(b); }

Person read_person(const YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MapReader reader(node, path, diagnostics);
  Person person;
  person.place = node.place();
  person.title = reader.text("title", "a person");
  person.stature = reader.number("stature", {Dimension::length, 0.5, 2.5});
  person.mass = reader.number("mass", {Dimension::mass, 2, 400});
  person.sex = reader.choice<Sex>("sex", kSexes);
  person.hand_length = reader.maybe_number("hand_length", {Dimension::length, 0.03, 0.5});
  person.hand_breadth = reader.maybe_number("hand_breadth", {Dimension::length, 0.01, 0.3});
  person.hand_circumference = reader.maybe_number("hand_circumference", {Dimension::length, 0.03, 0.8});
  person.hand_mass = reader.maybe_number("hand_mass", {Dimension::mass, 0.005, 5});
  person.grip_strength = reader.maybe_number("grip_strength", {Dimension::force, 1, 3000});
  person.age = reader.maybe_number("age", {Dimension::none, 0, 120});
  const auto lengths = [&](const char* key, double least, double most) {
    std::map<std::string, double> out;
    if (!reader.has(key)) return out;
    MapReader map = reader.map(key);
    for (const std::string& name : map.keys()) out[name] = map.number(name, {Dimension::length, least, most});
    map.finish();
    return out;
  };
  person.bones = lengths("bones", 0.003, 0.2);
  person.radii = lengths("radii", 0.001, 0.05);
  person.fingers = lengths("fingers", 0.01, 0.25);
  person.hand_length_percentile =
      reader.maybe_number("hand_length_percentile", {Dimension::none, 0.01, 99.99});
  if (person.hand_length && person.hand_length_percentile)
    reader.problem("hand_length_percentile", "a percentile beside a measured hand_length", "one of the two");
  if (reader.has("deviations")) {
    MapReader map = reader.map("deviations");
    for (const std::string_view name : kDeviations)
      if (const auto z = map.maybe_number(name, {Dimension::none, -6, 6}))
        person.deviations[std::string(name)] = *z;
    map.finish();
    const auto refuse = [&](const char* name, bool own) {
      if (own && person.deviations.contains(name))
        reader.problem("deviations", fmt::format("a deviation of {} beside the person's own", name),
                       "one of the two");
    };
    refuse("hand_length", person.hand_length_percentile.has_value());
    refuse("hand_mass", person.hand_mass.has_value());
    refuse("grip_strength", person.grip_strength.has_value());
  }
  if (reader.sound()) check_body(reader, person);
  reader.finish();
  return person;
}

}  // namespace handsim::hand
