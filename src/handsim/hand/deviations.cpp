#include "handsim/hand/deviations.h"

#include <algorithm>
#include <cmath>

namespace handsim::hand {

namespace {

/// Ends of a range nearer to zero than this move less: every hand can be straight [rad].
constexpr double kWholeShift = 0.35;

class Deviations {
 public:
  Deviations(const std::map<std::string, double>& spread, const Person& person)
      : spread_(spread), person_(person) {}

  /// In the spread's unit.
  double shift(const std::string& of) const {
    const auto found = spread_.find(of);
    return found == spread_.end() ? 0 : found->second * person_.deviation(of);
  }
  double factor(const std::string& of) const { return std::exp(shift(of)); }

 private:
  const std::map<std::string, double>& spread_;
  const Person& person_;
};

void scale(LengthRule& rule, double factor) {
  for (double* part : {&rule.metres, &rule.lengths, &rule.breadths, &rule.thicknesses}) *part *= factor;
}

void deviate(JointSpec& joint, double wider, double tissue) {
  for (model::JointAxis& axis : joint.axes) {
    if (axis.stop)
      for (double* end : {&axis.stop->low, &axis.stop->high})
        *end *= std::max(0.1, 1 + wider / std::max(std::abs(*end), kWholeShift));
    if (axis.tissue) {
      axis.tissue->stiffness *= tissue;
      axis.tissue->damping *= tissue;
    }
  }
}

void deviate(MuscleFile& file, const std::vector<HandAxis>& axes, const Person& person) {
  const Deviations by(file.spread, person);
  for (MuscleSpec& muscle : file.muscles) {
    const std::string kind = is_extrinsic(muscle, axes) ? "extrinsic" : "intrinsic";
    const double arms = by.factor(kind + "_arms");
    for (model::MomentArm& arm : muscle.tendon.path.arms)
      for (double& c : arm.c) c *= arms;
    for (model::ArmProduct& product : muscle.tendon.path.products) product.factor *= arms;
    muscle.force *= by.factor(kind + "_forces");
  }
}

}  // namespace

Person measured_again(const HandSpec& spec, const Person& person) {
  Person out = person;
  const auto found = spec.spread.find("measured");
  const auto again = [&](double& value, const char* name) {
    if (found != spec.spread.end()) value *= std::exp(found->second * person.deviation(name));
  };
  if (out.hand_length) again(*out.hand_length, "hand_length");
  if (out.hand_breadth) again(*out.hand_breadth, "hand_breadth");
  if (out.hand_circumference) again(*out.hand_circumference, "hand_circumference");
  for (auto* lengths : {&out.bones, &out.radii, &out.fingers})
    for (auto& [name, length] : *lengths) again(length, "segments");
  return out;
}

std::vector<std::string> uncertain_of(const HandSpec& spec, const Person& person, bool muscles) {
  const bool known = !spec.spread.contains("measured");
  const bool measured[] = {person.hand_length_percentile || (known && person.hand_length),
                           known && person.hand_breadth, false, known && person.hand_circumference};
  std::vector<std::string> out;
  for (std::size_t i = 0; i < kDeviations.size(); ++i) {
    const std::string name(kDeviations[i]);
    const bool acts = i < kHandDimensions       ? !measured[i]
                      : name == "grip_strength" ? !person.grip_strength
                      : name == "hand_mass"     ? !person.hand_mass && spec.spread.contains(name)
                                                : spec.spread.contains(name);
    if (acts || (muscles && spec.muscles && spec.muscles->spread.contains(name))) out.push_back(name);
  }
  return out;
}

HandSpec deviated(const HandSpec& spec, const Person& person) {
  HandSpec out = spec;
  const Deviations by(spec.spread, person);
  const double mass = by.factor("hand_mass"), wider = by.shift("ranges"),
               tissue = by.factor("passive_tissue");
  for (double* share : {&out.mass.male, &out.mass.female, &out.mass.unknown, &out.mass.density})
    *share *= mass;
  deviate(out.wrist, wider, tissue);
  for (SegmentSpec& segment : out.segments) {
    // A measured finger's length is its own.
    const bool metacarpal = segment.finger == "thumb" && !segment.parent;
    if (metacarpal || !person.fingers.contains(segment.finger)) scale(segment.length, by.factor("segments"));
    deviate(segment.joint, wider, tissue);
  }
  if (out.muscles) deviate(*out.muscles, hand_axes(spec), person);
  return out;
}

}  // namespace handsim::hand
