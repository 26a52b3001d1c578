#include "handsim/study/validate/validate.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "handsim/core/error.h"
#include "handsim/core/index.h"
#include "handsim/core/pose.h"
#include "handsim/environment/draws.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/model/pulleys.h"
#include "handsim/simulation/run/run.h"
#include "handsim/study/validate/subject.h"

namespace handsim::study {

namespace {

/// Mean arm and its root mean square difference from the measured ones.
std::pair<double, double> measure_arms(const Subject& subject, const Measurement& of) {
  const model::Muscle& muscle = *subject.muscle(of.muscle);
  const int dof = *subject.dof(of.axis);
  const double scale = of.hand_length ? *of.hand_length / subject.hand().size.length : 1;
  double sum = 0, squares = 0;
  Angles pose = of.pose;
  for (std::size_t i = 0; i < of.angles.size(); ++i) {
    pose[of.axis] = of.angles[i];
    const double arm = scale * subject.arm(muscle, dof, subject.coordinates(pose));
    sum += arm;
    squares += (arm - of.arms[i]) * (arm - of.arms[i]);
  }
  const auto n = static_cast<double>(of.angles.size());
  return {sum / n, std::sqrt(squares / n)};
}

double measure_excursion(const Subject& subject, const Measurement& of) {
  double sum = 0;
  for (const std::string& name : of.muscles) {
    const model::Muscle& muscle = *subject.muscle(name);
    sum += model::path_state(muscle.path, subject.coordinates(of.pose)).excursion -
           model::path_state(muscle.path, subject.coordinates(of.from)).excursion;
  }
  const double scale = of.hand_length ? *of.hand_length / subject.hand().size.length : 1;
  return scale * sum / static_cast<double>(of.muscles.size());
}

/// Force on what holds the tip in force and moment, per tension: joint moments r T = J^T (force, moment), of
/// the finger's flexion axes, with forces in the plane of flexion.
double measure_tip_share(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  const Eigen::MatrixXd J = subject.tip_jacobian(of.finger, q);
  const std::vector<int> dofs = subject.finger_dofs(of.finger);
  std::vector<Eigen::Index> planar;
  for (std::size_t i = 0; i < dofs.size(); ++i)
    for (const char* joint : {"_mcp.flexion", "_pip.flexion", "_dip.flexion"})
      if (subject.dof(of.finger + joint) == dofs[i]) planar.push_back(static_cast<Eigen::Index>(i));
  Eigen::Matrix3d A;
  Eigen::Vector3d tau = Eigen::Vector3d::Zero();
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Eigen::Index column = planar[as_index(static_cast<int>(k))];
    A.row(k) << J(1, column), J(2, column), J(3, column);
    for (const std::string& name : of.muscles)
      tau[k] += subject.arm(*subject.muscle(name), dofs[as_index(static_cast<int>(column))], q);
  }
  const Eigen::Vector3d force = A.inverse() * tau;
  if (of.direction == "any") return force.head<2>().norm();
  const Vec3 along = tip_direction(of.direction);
  return force[0] * along.y() + force[1] * along.z();
}

double measure_joint_moment(const Subject& subject, const Measurement& of) {
  const std::vector<double> q = subject.coordinates(of.pose);
  const int dof = *subject.dof(of.axis);
  const double sign = of.direction == "negative" ? -1 : 1;
  double sum = 0;
  for (const std::string& name : of.muscles) {
    const model::Muscle& muscle = *subject.muscle(name);
    const double arm = sign * subject.arm(muscle, dof, q);
    const double excursion = model::path_state(muscle.path, q).excursion;
    if (arm > 0)
      sum += arm * (model::isometric_force(muscle, excursion) + model::passive_force(muscle, excursion));
  }
  return sum;
}

/// Coordinates of a pose; fingers that it does not name are at their joints' rest angles.
std::vector<double> with_resting_fingers(const Subject& subject, const Angles& pose) {
  std::vector<double> out = subject.coordinates(pose);
  for (const hand::HandAxis& axis : subject.hand().axes)
    if (const std::optional<int> dof = subject.dof(axis.name); dof && !pose.contains(axis.name))
      out[as_index(*dof)] = axis.rest;
  return out;
}

double measure_rotation(const Subject& subject, const Measurement& of) {
  const std::vector<int> free = subject.finger_dofs(of.finger);
  const std::vector<double> rest = subject.balance(with_resting_fingers(subject, of.pose), free, {});
  const model::Muscle& muscle = *subject.muscle(of.muscle);
  const std::vector<double> loaded = subject.balance(rest, free, {{&muscle, of.load * muscle.force}});
  const auto dof = as_index(*subject.dof(of.axis));
  return loaded[dof] - rest[dof];
}

double measure_once(const Subject& subject, const Measurement& of) {
  const auto shares = [&] { return hand::whole_hand(subject.hand()).shares; };
  switch (of.kind) {
    case Measured::moment_arms:
      return measure_arms(subject, of).first;
    case Measured::excursion:
      return measure_excursion(subject, of);
    case Measured::tip_force_share:
      return measure_tip_share(subject, of);
    case Measured::tip_force:
      return largest_tip_force(subject, of);
    case Measured::pinch_force:
      return largest_pinch_force(subject, of);
    case Measured::joint_moment:
      return of.balanced.empty() ? measure_joint_moment(subject, of) : largest_moment(subject, of);
    case Measured::passive_moment:
      return subject.passive(with_resting_fingers(subject, of.pose))[as_index(*subject.dof(of.axis))];
    case Measured::loaded_rotation:
      return measure_rotation(subject, of);
    case Measured::coupled_angle:
      return subject.balance(
          with_resting_fingers(subject, of.pose),
          of.finger.empty() ? std::vector{*subject.dof(of.axis)} : subject.finger_dofs(of.finger),
          {})[as_index(*subject.dof(of.axis))];
    case Measured::pulley_force:
      if (of.segment == "A4") return model::pulley_forces({of.tension, 0}, of.angles.at(0)).a4;
      return model::pulley_forces({of.tension, 0}, of.angles.at(0)).a2;
    case Measured::sheath_friction:
      return 1 - std::pow(model::sheath_gain(of.angles.at(0)), -2);
    case Measured::hand_mass:
      return subject.hand().mass;
    case Measured::centre_of_mass:
      return shares().centre_of_mass;
    case Measured::gyration:
      return of.direction == "sagittal"     ? shares().gyration_sagittal
             : of.direction == "transverse" ? shares().gyration_transverse
                                            : shares().gyration_longitudinal;
    case Measured::grip_force:
    case Measured::simulation:
      break;  // of no subject
  }
  return 0;
}

double measure(const Subject& subject, const Measurement& of) {
  auto in_pose = [&, other = of](const Angles& pose) mutable {
    other.pose = pose;
    return measure_once(subject, other);
  };
  double out = measure_once(subject, of);
  for (const Angles& pose : of.or_poses) out = std::max(out, in_pose(pose));
  return of.over_pose ? out / in_pose(*of.over_pose) : out;
}

/// What stands at a path of keys, of indices of lists, and of `name`s of a list's entries, with or without
/// their hand: `contact_forces.fingers.index.force_at_end_N`. Null: there is nothing.
const nlohmann::json* found_at(const nlohmann::json& all, std::string_view path) {
  const nlohmann::json* now = &all;
  while (now && !path.empty()) {
    const std::string key(path.substr(0, path.find('.')));
    path.remove_prefix(std::min(path.size(), key.size() + 1));
    const nlohmann::json* next = nullptr;
    if (now->is_object() && now->contains(key)) {
      next = &now->at(key);
    } else if (now->is_array() && key.size() < 7 &&
               key.find_first_not_of("0123456789") == std::string::npos) {
      if (const std::size_t index = std::stoul(key); index < now->size()) next = &now->at(index);
    } else if (now->is_array()) {
      for (const nlohmann::json& entry : *now)
        if (const std::string name = entry.is_object() ? entry.value("name", "") : "";
            name == key || name.ends_with("." + key))
          next = &entry;
    }
    now = next;
  }
  return now;
}

/// The components of a number (one) or a vector (three); else none.
std::vector<double> components(const nlohmann::json* found) {
  if (found && found->is_number()) return {found->get<double>()};
  std::vector<double> out;
  if (found && found->is_array() && found->size() == 3)
    for (const nlohmann::json& each : *found)
      if (each.is_number()) out.push_back(each.get<double>());
  return out.size() == 3 ? out : std::vector<double>();
}

/// Runs scenes, each once for all rows that ask for it.
class SimulatedScenes {
 public:
  /// @param out folder for the files of the runs
  explicit SimulatedScenes(std::filesystem::path out) : out_(std::move(out)) {}
  /// The row's number. @throws Error (input) if the summary does not have it
  double figure(const Measurement& of) {
    const auto all = nlohmann::json::parse(summary(of));
    const auto sum = [&](const std::vector<std::string>& figures) {
      std::vector<double> out;
      for (const std::string& figure : figures) {
        const std::vector<double> each = components(found_at(all, figure));
        if (each.empty() || (!out.empty() && out.size() != each.size()))
          throw input_error(of.name, "no number " + figure + " in the summary of " + of.scene.string(),
                            "figures such as climbs.0.load_N, all numbers or all vectors");
        out.resize(each.size());
        for (std::size_t i = 0; i < each.size(); ++i) out[i] += each[i];
      }
      return out.size() == 1 ? out[0] : Vec3(out[0], out[1], out[2]).norm();
    };
    return of.over.empty() ? sum(of.figures) : sum(of.figures) / sum(of.over);
  }

 private:
  const std::string& summary(const Measurement& of) {
    const auto key = std::pair(of.scene, of.changes);
    if (const auto found = summaries_.find(key); found != summaries_.end()) return found->second;
    simulation::RunOptions options;
    options.out = out_ / fmt::format("run_{}", summaries_.size() + 1);
    return summaries_[key] = simulation::run(scene::load_scene(of.scene, of.changes), options).summary;
  }

  std::filesystem::path out_;
  std::map<std::pair<std::filesystem::path, std::vector<std::string>>, std::string>
      summaries_;  ///< by scene and overrides
};

/// The hands that rows measure, each built once.
struct Subjects {
  const ValidateSpec& spec;
  std::map<std::pair<std::string, std::string>, Subject> built = {};
  const Subject& of(const Measurement& row, const hand::Person& person) {
    const auto key = std::pair(row.person, row.hand);
    if (!built.contains(key)) built.emplace(key, Subject(spec.hand_of(row), person));
    return built.at(key);
  }
};

/// Draws hands of each person, and measures all rows that are no simulations on them.
void draw_hands(const ValidateSpec& spec, int count, const std::function<void(double)>& progress,
                ValidateResult& out) {
  std::map<std::string, UncertainPersons> drawn;
  for (const auto& [name, person] : spec.people)
    drawn.emplace(name, uncertain_persons(spec.hand, person, true, count));
  std::vector<std::vector<double>> ours(out.rows.size(), std::vector<double>(as_index(count)));
  std::atomic<int> next = 0;
  std::atomic<bool> stop = false;
  std::mutex mutex;
  double done = 0;
  in_threads(0, stop, [&] {
    for (int i = next++; i < count && !stop; i = next++) {
      Subjects subjects{spec};
      for (std::size_t r = 0; r < out.rows.size(); ++r)
        if (const Measurement& of = *out.rows[r].of; !of.has_scene()) try {
            ours[r][as_index(i)] = measure(subjects.of(of, drawn.at(of.person).persons[as_index(i)]), of);
            if (of.over_row) ours[r][as_index(i)] /= ours[*of.over_row][as_index(i)];
          } catch (const Error&) {
            // Such a hand has no posture in which moments balance.
            ours[r][as_index(i)] = NAN;
          }
      const std::lock_guard lock(mutex);
      if (progress) progress(++done / count);
    }
  });
  for (std::size_t r = 0; r < out.rows.size(); ++r) {
    const Measurement& of = *out.rows[r].of;
    if (of.has_scene()) continue;
    out.rows[r].uncertainty = uncertainty_of(drawn.at(of.person).inputs, ours[r]);
    for (std::size_t i = 0; i < ours[r].size(); ++i)
      ours[r][i] += of.spread * environment::Draws(2, i, of.name).normal();
    const Uncertainty both = uncertainty_of({}, ours[r]);
    out.rows[r].inside = both.low <= of.value && of.value <= both.high;
  }
}

/// Rows of one kind with the same bits have one value.
void weigh(std::vector<ValidateRow>& rows) {
  std::map<std::pair<Measured, double>, int> served;
  for (const ValidateRow& row : rows)
    if (row.measured) ++served[{row.of->kind, row.ours}];
  for (ValidateRow& row : rows)
    if (row.measured && row.ours != 0) row.weight = 1.0 / served[{row.of->kind, row.ours}];
}

}  // namespace

Tally ValidateResult::within(const RowFilter& of) const {
  Tally out;
  for (const ValidateRow& row : rows)
    if (row.measured && of(*row.of)) {
      out.values += row.weight;
      out.within += row.within() ? row.weight : 0;
    }
  return out;
}

Tally ValidateResult::covered(const RowFilter& of) const {
  Tally out;
  for (const ValidateRow& row : rows)
    if (row.uncertainty && of(*row.of)) {
      ++out.values;
      out.within += row.inside ? 1 : 0;
    }
  return out;
}

bool ValidateResult::passed() const {
  return std::ranges::all_of(
      rows, [](const ValidateRow& row) { return row.within() || !row.measured || !row.of->required; });
}

ValidateResult run_validate(const ValidateSpec& spec, const std::optional<std::filesystem::path>& runs,
                            std::optional<int> uncertain, const std::function<void(double)>& progress) {
  Subjects subjects{spec};
  ValidateResult out;
  std::optional<SimulatedScenes> scenes;
  if (runs) scenes.emplace(*runs);
  for (const Measurement& of : spec.measurements) {
    ValidateRow row;
    row.of = &of;
    if (of.kind == Measured::simulation) {
      row.measured = scenes.has_value();
      if (scenes) row.ours = scenes->figure(of);
    } else if (of.kind == Measured::grip_force) {
      row.ours = largest_grip_force(of);
    } else {
      row.ours = measure(subjects.of(of, spec.people.at(of.person)), of);
    }
    if (of.over_row && row.measured) row.ours /= out.rows[*of.over_row].ours;
    const double difference = of.kind == Measured::moment_arms
                                  ? measure_arms(subjects.of(of, spec.people.at(of.person)), of).second
                                  : std::abs(row.ours - of.value);
    row.deviation = difference / of.spread;
    out.rows.push_back(row);
  }
  weigh(out.rows);
  if (uncertain) draw_hands(spec, *uncertain, progress, out);
  return out;
}

}  // namespace handsim::study
