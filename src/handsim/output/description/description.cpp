#include "handsim/output/description/description.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Cholesky>
#include <nlohmann/json.hpp>

#include "handsim/engine/collision/pair_table.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/markers.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/output/render/draw_list.h"

namespace handsim::output {

namespace {

using Json = nlohmann::json;

constexpr const char* kShapeKinds[] = {"box", "capsule", "cylinder", "sphere", "convex_mesh", "plane"};
static_assert(std::size(kShapeKinds) == static_cast<std::size_t>(model::ShapeKind::plane) + 1);
constexpr const char* kPartNames[] = {"palm",   "thumb",  "index",  "middle",   "ring",
                                      "little", "object", "ground", "mechanism"};
static_assert(std::size(kPartNames) == static_cast<std::size_t>(model::Part::mechanism) + 1);

constexpr double kLastingLoad = 5;  ///< of the pads that stiffen and spin by their area [N]
constexpr double kSampling = 0.01;  ///< of a driven body's motion [s]
constexpr int kMostSamples = 2000;  ///< of the same

Json numbers(const Vec3& v) { return std::array{v.x(), v.y(), v.z()}; }
Json numbers(const Pose& x) {
  return std::array{x.p.x(), x.p.y(), x.p.z(), x.q.w(), x.q.x(), x.q.y(), x.q.z()};
}

/// A list of what a function makes of each.
template <class List, class Make>
Json each_of(const List& list, const Make& make) {
  Json out = Json::array();
  for (const auto& each : list) out.push_back(make(each));
  return out;
}

Json axis_json(const model::JointAxis& axis) {
  Json out = {{"name", axis.name}, {"axis", numbers(axis.axis)}, {"stop", nullptr}, {"tissue", nullptr}};
  if (axis.stop) out["stop"] = std::array{axis.stop->low, axis.stop->high};
  if (axis.tissue)
    out["tissue"] = std::array{axis.tissue->stiffness, axis.tissue->damping, axis.tissue->rest};
  return out;
}

Json joint_json(const model::Joint& joint) {
  std::vector<bool> slides;
  for (int k = 0; k < dof_count(joint.kind); ++k) slides.push_back(joint.slides(as_index(k)));
  return {{"name", joint.name},
          {"kind", joint.type().name},
          {"slides", slides},
          {"parent", joint.parent},
          {"child", joint.child},
          {"parent_frame", numbers(joint.parent_frame)},
          {"child_frame", numbers(joint.child_frame)},
          {"axes", each_of(joint.axes, axis_json)},
          {"closes_loop", joint.closes_loop},
          {"first", joint.first_dof}};
}

Json shape_json(const model::Model& model, const model::Shape& shape, const Colour& colour) {
  Json corners = Json::array(), faces = Json::array();
  for (int face = 0; shape.mesh && face < shape.mesh->face_count(); ++face) {
    const auto loop = shape.mesh->corners(face);
    for (std::size_t i = 1; i + 1 < loop.size(); ++i)
      faces.push_back(std::array{loop[0], loop[i], loop[i + 1]});
  }
  if (shape.mesh) corners = each_of(shape.mesh->vertices, [](const Vec3& v) { return numbers(v); });
  const model::Material& material = model.materials[as_index(shape.material)];
  return {{"name", shape.name},
          {"kind", kShapeKinds[static_cast<std::size_t>(shape.kind)]},
          {"body", shape.body},
          {"pose", numbers(shape.pose)},
          {"radius", shape.radius},
          {"length", shape.length},
          {"edges", numbers(shape.edges)},
          {"part", kPartNames[static_cast<std::size_t>(shape.part)]},
          {"colour", std::array{colour.r, colour.g, colour.b}},
          {"friction", material.friction},
          {"rolling_friction", material.rolling_friction},
          {"spinning_friction", material.spinning_friction},
          {"restitution", material.restitution},
          {"group", shape.group},
          {"corners", corners},
          {"faces", faces}};
}

/// Shapes with their colours, and the nails that are drawn on fingertips.
void add_shapes(const model::Model& model, Json& out) {
  const model::State zero = model::initial_state(model);
  std::vector<Colour> colours(model.shapes.size());
  out["nails"] = Json::array();
  for (const DrawShape& drawn : draw_list(model, zero, {}).shapes) {
    const model::Shape& on = model.shapes[as_index(drawn.shape)];
    if (!drawn.mark) colours[as_index(drawn.shape)] = drawn.colour;
    if (!drawn.mark || !drawn.fine) continue;
    model::Shape nail = on;
    nail.name += ".nail";
    nail.kind = model::ShapeKind::capsule;
    nail.pose = zero.bodies[as_index(on.body)].pose().inverse() * drawn.solid.pose;
    nail.radius = drawn.solid.round;
    nail.length = 2 * drawn.solid.half.z();
    out["nails"].push_back(shape_json(model, nail, drawn.colour));
  }
  out["shapes"] = Json::array();
  for (std::size_t i = 0; i < model.shapes.size(); ++i)
    out["shapes"].push_back(shape_json(model, model.shapes[i], colours[i]));
}

Json hand_json(const model::HandIndex& hand) {
  return {{"name", hand.name},
          {"bodies", hand.bodies},
          {"palm", hand.palm},
          {"wrist", numbers(hand.wrist_frame)},
          {"joints", hand.joints},
          {"tips", each_of(hand.fingertips, [](const model::Fingertip& tip) {
             return Json::array({tip.name, tip.body, numbers(tip.point)});
           })}};
}

Json path_json(const model::TendonPath& path, std::span<const double> q) {
  const model::PathState at = model::path_state(path, q);
  return {
      {"dofs", each_of(path.arms, [](const model::MomentArm& arm) { return arm.dof; })},
      {"polynomials", each_of(path.arms, [](const model::MomentArm& arm) { return arm.c; })},
      {"products", each_of(path.products,
                           [](const model::ArmProduct& each) {
                             return Json::array({each.a, each.b, each.power_a, each.power_b, each.factor});
                           })},
      {"excursion", at.excursion},
      {"arms", std::vector(at.arm.begin(), at.arm.begin() + std::ssize(path.arms))}};
}

Json muscle_json(const model::Muscle& muscle, std::span<const double> q) {
  const Json path = path_json(muscle.path, q);
  const double excursion = path["excursion"];
  return {{"name", muscle.name},
          {"path", path},
          {"force", muscle.force},
          {"fibre_length", muscle.fibre_length},
          {"slack_length", muscle.slack_length},
          {"length", muscle.length},
          {"pennation", muscle.pennation},
          {"activation_time", muscle.activation_time},
          {"deactivation_time", muscle.deactivation_time},
          {"max_speed", muscle.max_speed},
          {"excitable", muscle.excitable},
          {"spills", each_of(muscle.spills,
                             [](const model::Spill& each) {
                               return Json::array({each.from, each.share});
                             })},
          {"common_drive", muscle.common_drive},
          {"effort", muscle.effort},
          {"elastic", muscle.tendon_strain.has_value()},
          {"short_range", muscle.short_range.has_value()},
          {"isometric", model::isometric_force(muscle, excursion)},
          {"passive", model::passive_force(muscle, excursion)}};
}

Json band_json(const model::Band& band, std::span<const double> q) {
  return {{"name", band.name},           {"path", path_json(band.path, q)},
          {"stiffness", band.stiffness}, {"damping", band.damping},
          {"rest", band.rest},           {"both_ways", band.both_ways}};
}

/// The motion in samples.
Json drive_json(const model::Drive& drive) {
  double last = std::max(drive.motion.keys.back().time, kSampling);
  for (const model::Shake& shake : drive.motion.shakes) last = std::max(last, shake.end());
  const int samples = std::clamp(static_cast<int>(std::ceil(last / kSampling)), 3, kMostSamples);
  Json times = Json::array(), poses = Json::array();
  for (int i = 0; i <= samples; ++i) {
    times.push_back(last * i / samples);
    poses.push_back(numbers(drive.motion.at(last * i / samples)));
  }
  return {{"body", drive.body}, {"frame", numbers(drive.frame)}, {"times", times}, {"poses", poses}};
}

/// The servos of the plan at a state, by coordinate.
std::map<std::size_t, model::Servo> servos_of(const control::Plan& plan, const model::State& state) {
  std::vector<std::vector<double>> of_hand;
  for (const control::HandPlan& hand : plan.hands) {
    of_hand.emplace_back(hand.trajectory.width());
    hand.trajectory.at(state.time, of_hand.back());
  }
  std::map<std::size_t, model::Servo> out;
  for (const control::DrivenAxis& axis : plan.axes)
    out[axis.dof] = {axis.proportional, axis.derivative, of_hand[axis.hand][axis.column] - state.q[axis.dof],
                     0, axis.torque_limit};
  return out;
}

Json servos_json(const control::Plan* plan, const model::State& state,
                 const std::vector<model::Servo>& drives) {
  std::map<std::size_t, model::Servo> servos;
  for (std::size_t dof = 0; dof < drives.size(); ++dof)
    if (drives[dof].limit > 0) servos[dof] = drives[dof];
  if (plan && drives.empty()) servos = servos_of(*plan, state);
  return each_of(servos, [](const auto& each) {
    const auto& [dof, servo] = each;
    return Json{{"dof", dof},           {"stiffness", servo.stiffness}, {"damping", servo.damping},
                {"error", servo.error}, {"feed", servo.feed},           {"limit", servo.limit}};
  });
}

Json state_json(const model::State& state) {
  return {{"time", state.time},
          {"q", state.q},
          {"u", state.u},
          {"poses", each_of(state.bodies, [](const auto& body) { return numbers(body.pose()); })},
          {"velocities", each_of(state.bodies, [](const auto& body) { return numbers(body.v); })},
          {"turning", each_of(state.bodies, [](const auto& body) { return numbers(body.w); })}};
}

/// The spring and damper in place of a pad's law: its secant at kLastingLoad of a press that lasts, and of
/// this the shortest of the times in which it relaxes.
model::Compliance straightened(const model::Compliance& pad) {
  if (!pad.law) return pad;
  const double stiffness = pad.secant(kLastingLoad);
  double time = 0;
  for (const model::Relaxation& part : pad.law->relaxations)
    time = time == 0 ? part.time : std::min(time, part.time);
  model::Compliance out{stiffness, pad.damping + time * stiffness};
  out.radius = pad.radius;
  return out;
}

Json surface_json(model::Material pair) {
  const bool stiffens = pair.compliance && (pair.compliance->law || pair.spins_by_area);
  if (stiffens) {
    if (pair.friction_over_load) pair.friction *= pair.friction_over_load->factor(kLastingLoad);
    pair.compliance = straightened(*pair.compliance);
    pair.spinning_friction = pair.spinning(pair.friction, kLastingLoad / pair.compliance->stiffness);
  }
  Json out = {{"friction", pair.friction},
              {"rolling_friction", pair.rolling_friction},
              {"spinning_friction", pair.spinning_friction},
              {"spring", nullptr},
              {"stiffens", stiffens}};
  if (pair.compliance) out["spring"] = std::array{pair.compliance->stiffness, pair.compliance->damping};
  return out;
}

/// How fast a force at the centre of mass of each body accelerates it, the mean over three directions, at
/// zero coordinates [1/kg]. Zero for the world and kinematic bodies.
std::vector<double> mobilities(const model::Model& model) {
  const std::vector<double> zeros(as_index(model.dof_count()));
  const model::State state = model::state_at(model, zeros);
  const std::vector<int> free = model::free_bodies(model);
  std::vector<int> bodies(model.bodies.size());
  std::iota(bodies.begin(), bodies.end(), 0);
  // Semidefinite: a joint that closes a loop has columns of zeros.
  const auto factor = model::mass_matrix(model, state, bodies, free).ldlt();
  std::vector<double> out;
  for (const int body : bodies) {
    const Eigen::MatrixXd J =
        model::jacobian(model, state, body, state.bodies[as_index(body)].p, free).topRows<3>();
    out.push_back((J * factor.solve(J.transpose())).trace() / 3);
  }
  return out;
}

/// Adds the key of contact: which groups meet; every two shapes that may touch, with their surface;
/// mobilities where some surface gives way.
void add_contact(const model::Model& model, Json& out) {
  out["groups"] = model.groups.size();
  out["rules"] = each_of(model.contact_rules, [](const model::ContactRule& rule) {
    return std::array{rule.group_a, rule.group_b};
  });
  const engine::PairTable rules(model);
  std::vector<bool> immovable(model.bodies.size());
  for (std::size_t i = 0; i < immovable.size(); ++i)
    immovable[i] = i == model::kWorld || model.bodies[i].kinematic;
  const engine::UntestedPairs untested(model, immovable);
  std::map<Json, std::size_t> known;
  out["pairs"] = out["surfaces"] = Json::array();
  bool soft = false;
  for (std::size_t i = 0; i < model.shapes.size(); ++i)
    for (std::size_t j = i + 1; j < model.shapes.size(); ++j) {
      const model::Shape &a = model.shapes[i], &b = model.shapes[j];
      if (!rules.meet(a.group, b.group) || untested(a.body, b.body)) continue;
      const auto [found, fresh] = known.try_emplace(surface_json(rules.between(a, b)), known.size());
      if (fresh) out["surfaces"].push_back(found->first);
      soft = soft || !found->first["spring"].is_null();
      out["pairs"].push_back(std::array{i, j, found->second});
    }
  out["lasting_load"] = kLastingLoad;
  out["mobilities"] = soft ? Json(mobilities(model)) : Json();
}

Json effects_json(const engine::Settings& settings) {
  Json out = Json::array();
  for (int i = 0; i < model::kEffectCount; ++i)
    if (const auto effect = static_cast<model::Effect>(i); settings.effects.has(effect))
      out.push_back(name(effect));
  return out;
}

}  // namespace

Moment moment_after(const model::State& state, const control::Controller* controller) {
  Moment out{state, {}};
  if (!controller) return out;
  out.drives.assign(controller->servos().begin(), controller->servos().end());
  if (out.drives.empty()) return out;
  for (std::size_t i = 0; i < controller->axes().size(); ++i) {
    const control::AxisState& axis = controller->axes()[i];
    out.drives[controller->plan().axes[i].dof].error = axis.target - axis.angle;
  }
  return out;
}

std::string description(const model::Model& model, const engine::Settings& settings,
                        const control::Plan* plan, const Moment* moment) {
  const model::State start = moment ? moment->state : model::initial_state(model);
  using namespace model::hill;
  Json out = {
      {"gravity", numbers(model.gravity)},
      {"step", settings.step},
      {"effects", effects_json(settings)},
      {"bodies", each_of(model.bodies,
                         [](const model::Body& body) {
                           const Mat3& I = body.inertia;
                           return Json{{"name", body.name},
                                       {"mass", body.mass},
                                       {"inertia", {numbers(I.col(0)), numbers(I.col(1)), numbers(I.col(2))}},
                                       {"zero", numbers(body.zero_pose)},
                                       {"fixed", body.kinematic}};
                         })},
      {"joints", each_of(model.joints, joint_json)},
      {"hands", each_of(model.hands, hand_json)},
      {"markers", each_of(model::hand_markers(model),
                          [](const model::Marker& marker) {
                            return Json::array({marker.name, marker.body, numbers(marker.point)});
                          })},
      {"drives", each_of(model.drives, drive_json)},
      {"muscles", each_of(model.muscles, [&](const auto& muscle) { return muscle_json(muscle, start.q); })},
      {"bands", each_of(model.bands, [&](const auto& band) { return band_json(band, start.q); })},
      {"curves",
       {{"active_width", kActiveWidth},
        {"passive_shape", kPassiveShape},
        {"passive_strain", kPassiveStrain},
        {"speed_shape", kSpeedShape},
        {"lengthening", kLengthening},
        {"shortest", kShortest},
        {"longest", kLongest},
        {"steep", kSteep}}},
      {"servos", servos_json(plan, start, moment ? moment->drives : std::vector<model::Servo>())},
      {"implicit", plan && plan->form == control::Form::implicit_gain},
      {"start", state_json(start)}};
  add_shapes(model, out);
  add_contact(model, out);
  return out.dump();
}

}  // namespace handsim::output
