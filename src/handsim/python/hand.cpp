#include "handsim/hand/build.h"

#include <algorithm>

#include "handsim/app/commands.h"
#include "handsim/core/data_folder.h"
#include "handsim/engine/collision/overlap.h"
#include "handsim/hand/deviations.h"
#include "handsim/hand/grip_strength.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/model/newton_euler.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"

namespace handsim::python {

namespace {

using Column = std::vector<double>;

/// @throws Error (input) without hands.
const model::HandIndex& first_hand(const SceneHandle& of) {
  if (of.scene->model.hands.empty()) throw input_error("scene", "a scene without hands", "one with a hand");
  return of.scene->model.hands.front();
}

std::string part_name(const std::string& body) { return body.substr(body.find('.') + 1); }

/// Bodies of the scene's first hand in its hand frame: palm, then segments with a joint; with the row of the
/// body that carries each. The palm's length is that of the box about its shapes.
py::dict segments(const SceneHandle& of) {
  const model::Model& model = of.scene->model;
  const model::HandIndex& hand = first_hand(of);
  const hand::BuiltHand& built = of.scene->hands.front();
  const Pose x_HW = (model.bodies[as_index(hand.palm)].zero_pose * hand.wrist_frame).inverse();
  const Vec3 box = hand::palm_box(built);
  std::vector<std::string> names, joints;
  std::vector<int> parents;
  Column length, radius, mass, centre, inertia;
  for (std::size_t i = 0; i < hand.bodies.size(); ++i) {
    const model::Body& body = model.bodies[as_index(hand.bodies[i])];
    const auto segment = std::ranges::find_if(
        built.segments, [&](const auto& each) { return each.joint && each.body == static_cast<int>(i); });
    const bool palm = segment == built.segments.end();
    names.push_back(part_name(body.name));
    joints.push_back(palm ? "" : built.joints[as_index(*segment->joint)].name);
    parents.push_back(palm ? -1 : built.joints[as_index(*segment->joint)].parent);
    length.push_back(palm ? box.y() : segment->length);
    radius.push_back(palm ? box.z() / 2 : segment->radius);
    mass.push_back(body.mass);
    append(centre, x_HW * body.zero_pose.p);
    append(inertia, body.inertia.diagonal());
  }
  py::dict out;
  out["name"] = names;
  out["joint"] = joints;
  out["parent"] = py::array(py::cast(parents));
  out["length[m]"] = array_of(length);
  out["radius[m]"] = array_of(radius);
  out["mass[kg]"] = array_of(mass);
  out["centre_of_mass[m]"] = array_of(centre, 3);
  out["inertia[kg m^2]"] = array_of(inertia, 3);
  return out;
}

/// One number for each coordinate.
Numbers coordinates_of(const model::Model& model, const py::object& numbers, const char* name) {
  Numbers out(numbers, {static_cast<py::ssize_t>(model.dof_count())}, name);
  for (const double each : out.span())
    if (!std::isfinite(each)) throw input_error(name, std::to_string(each), "finite numbers");
  return out;
}

/// The first hand at coordinates, with its hand frame at the origin of the world.
struct Posture {
  const model::Model& model;
  const model::HandIndex& hand;
  model::State state;

  Posture(const SceneHandle& of, const py::object& q) : model(of.scene->model), hand(first_hand(of)) {
    state = model::state_at(model, coordinates_of(model, q, "q").span());
    const Pose x_HW = (state.bodies[as_index(hand.palm)].pose() * hand.wrist_frame).inverse();
    for (model::BodyState& body : state.bodies) {
      const Pose x_HB = x_HW * body.pose();
      body.p = x_HB.p;
      body.q = x_HB.q;
    }
  }
};

py::array_t<double> matrix(const Eigen::MatrixXd& of) {
  py::array_t<double> out({of.rows(), of.cols()});
  for (Eigen::Index i = 0; i < of.rows(); ++i)
    for (Eigen::Index k = 0; k < of.cols(); ++k) out.mutable_at(i, k) = of(i, k);
  return out;
}

py::tuple poses(const SceneHandle& of, const py::object& q) {
  const Posture posture(of, q);
  Column position, quaternion;
  for (const int body : posture.hand.bodies) {
    append(position, posture.state.bodies[as_index(body)].p);
    append(quaternion, posture.state.bodies[as_index(body)].q);
  }
  return py::make_tuple(array_of(position, 3), array_of(quaternion, 4));
}

/// @param body row among the hand's bodies
py::array_t<double> jacobian(const SceneHandle& of, const py::object& q, std::size_t body,
                             const py::object& offset) {
  const Posture posture(of, q);
  const Numbers point(offset, {3}, "offset");
  const int index = posture.hand.bodies.at(body);
  return matrix(model::jacobian(posture.model, posture.state, index,
                                posture.state.bodies[as_index(index)].pose() * Vec3(point.span().data())));
}

py::array_t<double> mass_matrix(const SceneHandle& of, const py::object& q) {
  const Posture posture(of, q);
  return matrix(model::mass_matrix(posture.model, posture.state, posture.hand.bodies));
}

py::array_t<double> inverse_dynamics(const SceneHandle& of, const py::object& q, const py::object& u,
                                     const py::object& a, const py::object& gravity) {
  Posture posture(of, q);
  const Numbers rates = coordinates_of(posture.model, u, "u"), change = coordinates_of(posture.model, a, "a");
  const Vec3 pull(Numbers(gravity, {3}, "gravity").span().data());
  posture.state.u.assign(rates.span().begin(), rates.span().end());
  return array_of(model::inverse_dynamics(posture.model, posture.state, change.span(), pull));
}

/// The muscles at coordinates: moment arms by muscle and coordinate [m], excursions [m], the force that
/// full activation adds, and the force at rest [N]. By coordinate: the torque of bands [N m].
py::tuple muscles_at(const SceneHandle& of, const py::object& q) {
  const model::Model& model = of.scene->model;
  const Numbers at = coordinates_of(model, q, "q");
  Eigen::MatrixXd arms =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(model.muscles.size()), model.dof_count());
  Column excursion, active, passive, torque(at.span().size());
  for (const model::Muscle& muscle : model.muscles) {
    const model::PathState path = model::path_state(muscle.path, at.span());
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i)
      arms(static_cast<Eigen::Index>(excursion.size()), muscle.path.arms[i].dof) = path.arm[i];
    excursion.push_back(path.excursion);
    active.push_back(model::isometric_force(muscle, path.excursion));
    passive.push_back(model::passive_force(muscle, path.excursion));
  }
  for (const model::Band& band : model.bands) {
    const model::PathState path = model::path_state(band.path, at.span());
    const double pull = -band.stiffness * (path.excursion + band.rest);
    for (std::size_t i = 0; i < band.path.arms.size(); ++i)
      torque[as_index(band.path.arms[i].dof)] += path.arm[i] * (band.both_ways ? pull : std::max(0.0, pull));
  }
  return py::make_tuple(matrix(arms), array_of(excursion), array_of(active), array_of(passive),
                        array_of(torque));
}

/// Length and mass; centre of mass from the wrist and radii of gyration about three axes, over the length
/// [1].
py::dict whole_hand(const SceneHandle& of) {
  first_hand(of);
  const hand::BuiltHand& built = of.scene->hands.front();
  const auto found = hand::whole_hand(built).shares;
  return py::dict(py::arg("length") = built.size.length, py::arg("mass") = built.mass,
                  py::arg("centre_of_mass") = found.centre_of_mass,
                  py::arg("sagittal") = found.gyration_sagittal,
                  py::arg("transverse") = found.gyration_transverse,
                  py::arg("longitudinal") = found.gyration_longitudinal);
}

/// Size, mass and strength of the first hand.
py::dict dimensions(const SceneHandle& of) {
  first_hand(of);
  const hand::BuiltHand& built = of.scene->hands.front();
  const hand::WholeHand whole = hand::whole_hand(built);
  YamlNode norms = load_yaml(data_folder() / "handmodels/grip_strength.yaml");
  Diagnostics diagnostics;
  const hand::GripTable table = hand::read_grip_table(norms, "", diagnostics);
  diagnostics.throw_if_any();
  py::dict out;
  out["length[m]"] = built.size.length;
  out["breadth[m]"] = built.size.breadth;
  out["palm_length[m]"] = built.size.palm_length;
  out["circumference[m]"] = built.size.circumference;
  out["thickness[m]"] = built.size.thickness;
  for (const auto& [name, finger] : built.size.fingers) out[(name + "_length[m]").c_str()] = finger.length;
  out["mass[kg]"] = built.mass;
  out["centre_of_mass[m]"] = whole.shares.centre_of_mass * built.size.length;
  out["grip_strength[N]"] = hand::grip_strength(table, of.scene->spec.hands.front().person).own;
  return out;
}

/// Name, type, and axes with their stops, as name, low and high [rad].
py::tuple joint_facts(const model::Joint& joint) {
  py::list axes;
  for (const model::JointAxis& axis : joint.axes)
    axes.append(py::make_tuple(axis.name, axis.stop ? std::optional(axis.stop->low) : std::nullopt,
                               axis.stop ? std::optional(axis.stop->high) : std::nullopt));
  return py::make_tuple(joint.name, joint.type().name, axes);
}

/// What `handsim hand` prints of the first hand beside its dimensions: _hand_command.py names the fields.
py::dict hand_facts(const SceneHandle& of) {
  const hand::BuiltHand& built = of.scene->hands.front();
  const hand::Person& person = of.scene->spec.hands.front().person;
  const hand::HandSpec& spec = *of.scene->spec.hands.front().model;
  const bool female = person.sex == hand::Sex::female;
  const hand::Anthropometry& survey = spec.anthropometry;
  const hand::HandInertiaShares& shares = female ? survey.reference_female : survey.reference_male;
  constexpr const char* kRules[] = {"share", "tissue", "density"};
  const double share = person.sex == hand::Sex::male ? spec.mass.male
                       : female                      ? spec.mass.female
                                                     : spec.mass.unknown;
  py::list bodies, segments;
  for (const model::Body& body : built.bodies) {
    Column inertia;
    append(inertia, body.inertia.diagonal());
    bodies.append(py::make_tuple(body.name, body.mass, inertia));
  }
  for (std::size_t i = 0; i < built.segments.size(); ++i) {
    const hand::BuiltSegment& each = built.segments[i];
    py::object joint = py::none();
    if (each.joint) joint = joint_facts(built.joints[as_index(*each.joint)]);
    segments.append(py::make_tuple(spec.segments[i].name, spec.segments[i].carrier, each.length, each.radius,
                                   each.body, joint));
  }
  Column box;
  append(box, hand::palm_box(built));
  using py::arg;
  return py::dict(
      arg("stature") = person.stature, arg("mass") = person.mass, arg("sex") = hand::name(person.sex),
      arg("age") = person.age, arg("weighed") = person.hand_mass.has_value(),
      arg("measured") = built.size.measured, arg("fingers") = person.fingers,
      arg("rule") = py::make_tuple(kRules[static_cast<int>(spec.mass.kind)], share, spec.mass.density,
                                   spec.mass.source),
      arg("survey") = hand::survey_of(survey, person).source,
      arg("palm") = py::make_tuple(box, built.palm_volume,
                                   std::ranges::count(built.shapes, model::Part::palm, &model::Shape::part)),
      arg("bodies") = bodies, arg("segments") = segments, arg("wrist") = joint_facts(built.wrist),
      arg("reference") =
          py::make_tuple(survey.reference_source, shares.centre_of_mass, shares.gyration_sagittal,
                         shares.gyration_transverse, shares.gyration_longitudinal),
      arg("title") = spec.title, arg("sources") = spec.sources,
      arg("uncertain") = hand::uncertain_of(spec, person, false));
}

/// A drawn hand: stature [m], mass [kg] and sex, or the scene's person; and deviations.
using DrawnHand =
    std::pair<std::optional<std::tuple<double, double, std::string>>, std::map<std::string, double>>;

/// A row for each drawn hand of the first hand's model: size [m] and mass [kg], lengths of segments [m], and
/// upper stops [rad].
py::array_t<double> hand_figures(const SceneHandle& of, const std::vector<DrawnHand>& drawn) {
  first_hand(of);
  const scene::HandEntry& entry = of.scene->spec.hands.front();
  Column out;
  for (const auto& [body, deviations] : drawn) {
    hand::Person person = body ? hand::Person() : entry.person;
    std::string sex;
    if (body) std::tie(person.stature, person.mass, sex) = *body;
    if (body) person.sex = sex == "male" ? hand::Sex::male : hand::Sex::female;
    for (const auto& [name, deviation] : deviations) person.deviations[name] = deviation;
    const hand::BuiltHand built = hand::build_hand(*entry.model, person);
    const hand::HandSize& size = built.size;
    out.insert(out.end(),
               {size.length, size.breadth, size.palm_length, size.circumference, size.thickness, built.mass});
    for (std::size_t i = 0; i < built.segments.size(); ++i)
      if (!entry.model->segments[i].carrier) out.push_back(built.segments[i].length);
    for (const model::Joint& joint : built.joints)
      for (const model::JointAxis& axis : joint.axes)
        if (axis.stop) out.push_back(axis.stop->high);
  }
  return array_of(out, out.size() / drawn.size());
}

/// A scene of a person's hands alone, straight, side by side, backs up: their parts may touch each other, and
/// what they grip in another program. With what is doubtful of them.
/// @param measures texts by key of a person file. @param model absent: the anatomical hand
py::tuple person_hands(const std::optional<std::filesystem::path>& person,
                       const std::map<std::string, std::string>& measures,
                       const std::optional<std::filesystem::path>& model, const std::string& side,
                       const std::string& mount, bool muscles) {
  model::Effects effects;
  for (const model::Effect effect :
       {model::Effect::gravity, model::Effect::self_contact, model::Effect::friction,
        model::Effect::joint_stops, model::Effect::passive_tissue})
    effects.add(effect);
  app::PersonHands input = app::read_person_hands({person, measures, model, side});
  const std::vector<std::string> warnings = input.warnings;
  if (muscles) {
    if (!input.model.muscles)
      throw input_error("--muscles", "a hand model without muscles", "a hand model that has muscles");
    effects.add(model::Effect::muscles);
    if (!input.model.muscles->bands.empty()) effects.add(model::Effect::tendon_coupling);
  }
  constexpr std::pair<const char*, hand::Mount> kMounts[] = {{"fixed", hand::Mount::fixed},
                                                             {"hinge", hand::Mount::hinge},
                                                             {"universal", hand::Mount::universal},
                                                             {"free", hand::Mount::free}};
  const auto held = std::ranges::find(kMounts, mount, &std::pair<const char*, hand::Mount>::first);
  return py::make_tuple(SceneHandle{std::make_shared<const scene::Scene>(
                            app::compile_hands(side, held->second, effects, std::move(input)))},
                        warnings);
}

}  // namespace

void bind_hand(py::module_& module) {
  module.def("hand_facts", &hand_facts);
  module.def("hand_figures", &hand_figures);
  module.def("overlap_texts", [](const SceneHandle& of) {
    const model::Model& model = of.scene->model;
    return app::overlap_texts(model, engine::initial_overlaps(model, model::initial_state(model)));
  });
  module.def("person_hands", &person_hands);
  module.def("hand_dimensions", &dimensions);
  module.def("hand_segments", &segments);
  module.def("hand_poses", &poses);
  module.def("hand_jacobian", &jacobian);
  module.def("hand_mass_matrix", &mass_matrix);
  module.def("hand_inverse_dynamics", &inverse_dynamics);
  module.def("hand_muscles", &muscles_at);
  module.def("whole_hand", &whole_hand);
}

}  // namespace handsim::python
