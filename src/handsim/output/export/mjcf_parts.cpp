#include <algorithm>
#include <numeric>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "handsim/engine/collision/pair_table.h"
#include "handsim/model/kinematics.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/output/export/export_tree.h"

namespace handsim::output {

namespace {

std::vector<std::string> coordinate_labels(const model::Model& model) {
  std::vector<std::string> out(as_index(model.dof_count()));
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      out[as_index(joint.first_dof) + a] = joint.name + "." + joint.axes[a].name;
  return out;
}

/// A fixed tendon, whose length is the sum of coefficients times angles: coefficients are minus the arms.
std::string fixed_tendon(const std::string& name, const model::TendonPath& path,
                         const model::PathState& state, const std::vector<std::string>& labels,
                         const std::string& attributes) {
  std::string out = fmt::format("    <fixed name=\"{}\"{}>\n", attribute(name), attributes);
  for (std::size_t i = 0; i < path.arms.size(); ++i)
    out += fmt::format("      <joint joint=\"{}\" coef=\"{:.17g}\"/>\n",
                       attribute(labels[as_index(path.arms[i].dof)]), -state.arm[i]);
  return out + "    </fixed>\n";
}

void add_muscle(const model::Muscle& muscle, const model::State& state,
                const std::vector<std::string>& labels, MjcfTendons& out) {
  // MJCF knows no tendon without a joint.
  if (muscle.path.arms.empty()) return;
  const model::PathState path = model::path_state(muscle.path, state.q);
  out.tendons += fixed_tendon(muscle.name, muscle.path, path, labels, "");
  ++out.count;
  out.actuators += fmt::format(
      "    <general name=\"{0}\" tendon=\"{0}\" dyntype=\"muscle\" dynprm=\"{1:.17g} {2:.17g}\" "
      "gaintype=\"fixed\" gainprm=\"{3:.17g}\" biastype=\"affine\" biasprm=\"{4:.17g} 0 0\" "
      "ctrllimited=\"true\" ctrlrange=\"0 1\"/>\n",
      attribute(muscle.name), muscle.activation_time, muscle.deactivation_time,
      -model::isometric_force(muscle, path.excursion), -model::passive_force(muscle, path.excursion));
}

void add_band(const model::Band& band, const model::State& state, const std::vector<std::string>& labels,
              MjcfTendons& out) {
  if (band.path.arms.empty()) return;
  const model::PathState path = model::path_state(band.path, state.q);
  // MuJoCo's length is that of constant arms: its rest length differs as the lengths do at the state.
  double length = 0;
  for (std::size_t i = 0; i < band.path.arms.size(); ++i)
    length -= path.arm[i] * state.q[as_index(band.path.arms[i].dof)];
  const double rest = band.rest + length + path.excursion;
  // A band that goes slack is a limit there: MuJoCo's springs work both ways.
  const std::string law =
      band.both_ways ? fmt::format(" stiffness=\"{:.17g}\" damping=\"{:.17g}\" springlength=\"{:.17g}\"",
                                   band.stiffness, band.damping, rest)
                     : fmt::format(" limited=\"true\" range=\"-1 {:.17g}\"", rest);
  out.tendons += fixed_tendon(band.name, band.path, path, labels, law);
}

using model::Effect;

/// A spring-damper at the step's end, f = -(K (r + h v+) + c v+) for a gap r and its rate v+ after the step
/// of length h. MuJoCo's contact is f = -(a + b v + k r) / R with the acceleration a = (v+ - v) / h, so b = 1
/// / h, R = 1 / (h (c + h K)) and k = K R. It takes R from the impedance d, as (1 - d) / d times the mobility
/// of the two bodies, and from `solref` d k and d b. Friction shares b: it stops a slip within a step.
std::string spring_damper(const model::Compliance& pad, double mobility, double h) {
  const double R = 1 / (h * (pad.damping + h * pad.stiffness));
  const double d = mobility / (mobility + R);
  return fmt::format(" solref=\"{0:.17g} {1:.17g}\" solimp=\"{2:.17g} {2:.17g} 0.001\"",
                     -d * pad.stiffness * R, -d / h, d);
}

constexpr double kPadLoad = 5;  ///< of the pads that stiffen and spin by their area [N]

/// The spring and damper in place of a pad's law: its secant at kPadLoad of a press that lasts, and of this
/// the shortest of the times in which it relaxes.
model::Compliance straightened(const model::Compliance& pad) {
  if (!pad.law) return pad;
  const double stiffness = pad.secant(kPadLoad);
  double time = 0;
  for (const model::Relaxation& part : pad.law->relaxations)
    time = time == 0 ? part.time : std::min(time, part.time);
  model::Compliance out{stiffness, pad.damping + time * stiffness};
  out.radius = pad.radius;
  return out;
}

/// What MuJoCo makes of two surfaces by itself.
bool combined_there(const model::Material& a, const model::Material& b, const model::Material& pair,
                    bool friction) {
  if (pair.compliance) return false;
  return !friction || (pair.friction == std::max(a.friction, b.friction) &&
                       pair.rolling_friction == std::max(a.rolling_friction, b.rolling_friction) &&
                       pair.spinning_friction == std::max(a.spinning_friction, b.spinning_friction));
}

/// MuJoCo's `body_invweight0` of bodies by index [1/kg]: how fast a force at the centre of mass accelerates
/// it, the mean over three directions, at zero coordinates. Zero for the world and kinematic bodies.
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

}  // namespace

MjcfTendons mjcf_tendons(const model::Model& model, const engine::Settings& settings,
                         const model::State& state) {
  MjcfTendons out;
  const std::vector<std::string> labels = coordinate_labels(model);
  if (settings.effects.has(model::Effect::muscles))
    for (const model::Muscle& muscle : model.muscles) add_muscle(muscle, state, labels, out);
  if (settings.effects.has(model::Effect::tendon_coupling))
    for (const model::Band& band : model.bands) add_band(band, state, labels, out);
  return out;
}

std::string mjcf_friction(const model::Material& surface, const engine::Settings& settings, bool of_pair) {
  if (!settings.effects.has(Effect::friction)) return " condim=\"1\"";
  const double mu = surface.friction, spin = surface.spinning_friction, roll = surface.rolling_friction;
  const int condim = roll > 0 ? 6 : spin > 0 ? 4 : mu > 0 ? 3 : 1;
  return of_pair ? fmt::format(" condim=\"{0}\" friction=\"{1:.17g} {1:.17g} {2:.17g} {3:.17g} {3:.17g}\"",
                               condim, mu, spin, roll)
                 : fmt::format(" condim=\"{}\" friction=\"{:.17g} {:.17g} {:.17g}\"", condim, mu, spin, roll);
}

std::string mjcf_pairs(const model::Model& model, const engine::Settings& settings) {
  const engine::PairTable rules(model);
  std::vector<bool> immovable(model.bodies.size());
  for (std::size_t i = 0; i < immovable.size(); ++i)
    immovable[i] = i == model::kWorld || model.bodies[i].kinematic;
  const engine::UntestedPairs untested(model, immovable);
  const bool friction = settings.effects.has(Effect::friction);
  std::vector<double> mobility;
  bool stiffens = false;
  std::string out;
  for (std::size_t i = 0; i < model.shapes.size(); ++i)
    for (std::size_t j = i + 1; j < model.shapes.size(); ++j) {
      const model::Shape &a = model.shapes[i], &b = model.shapes[j];
      if (!rules.meet(a.group, b.group) || untested(a.body, b.body)) continue;
      model::Material pair = rules.between(a, b);
      if (pair.compliance && (pair.compliance->law || pair.spins_by_area)) {
        if (!stiffens)
          out += fmt::format(
              "    <!-- Pads that stiffen: the secant and the area of a lasting press of {:g} N -->\n",
              kPadLoad);
        stiffens = true;
        if (pair.friction_over_load) pair.friction *= pair.friction_over_load->factor(kPadLoad);
        pair.compliance = straightened(*pair.compliance);
        pair.spinning_friction = pair.spinning(pair.friction, kPadLoad / pair.compliance->stiffness);
      }
      if (combined_there(model.materials[as_index(a.material)], model.materials[as_index(b.material)], pair,
                         friction))
        continue;
      out += fmt::format("    <pair geom1=\"{}\" geom2=\"{}\"{}", attribute(a.name), attribute(b.name),
                         mjcf_friction(pair, settings, true));
      if (pair.compliance) {
        if (mobility.empty()) mobility = mobilities(model);
        out += spring_damper(*pair.compliance, mobility[as_index(a.body)] + mobility[as_index(b.body)],
                             settings.step);
      }
      out += "/>\n";
    }
  return out;
}

}  // namespace handsim::output
