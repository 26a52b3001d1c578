#include "handsim/output/export/mjcf_parts.h"

#include <vector>

#include <fmt/format.h>

#include "handsim/core/index.h"
#include "handsim/model/muscle_curves.h"
#include "handsim/output/export/export_tree.h"

namespace handsim::output {

namespace {

/// `joint.axis` of every coordinate.
std::vector<std::string> coordinate_labels(const model::Model& model) {
  std::vector<std::string> out(at(model.dof_count()));
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      out[at(joint.first_dof) + a] = joint.name + "." + joint.axes[a].name;
  return out;
}

/// A fixed tendon, whose length is the sum of coefficients times angles: coefficients are minus the arms.
std::string fixed_tendon(const std::string& name, const model::TendonPath& path,
                         const model::PathState& state, const std::vector<std::string>& labels,
                         const std::string& attributes) {
  std::string out = fmt::format("    <fixed name=\"{}\"{}>\n", attribute(name), attributes);
  for (std::size_t i = 0; i < path.arms.size(); ++i)
    out += fmt::format("      <joint joint=\"{}\" coef=\"{:.17g}\"/>\n",
                       attribute(labels[at(path.arms[i].dof)]), -state.arm[i]);
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

void add_band(const model::Ligament& band, const model::State& state, const std::vector<std::string>& labels,
              MjcfTendons& out) {
  if (band.path.arms.empty()) return;
  const model::PathState path = model::path_state(band.path, state.q);
  // MuJoCo's length is that of constant arms: its rest length differs by as much as the lengths do at the
  // state.
  double length = 0;
  for (std::size_t i = 0; i < band.path.arms.size(); ++i)
    length -= path.arm[i] * state.q[at(band.path.arms[i].dof)];
  const double rest = band.rest + length + path.excursion;
  // A band that goes slack is a limit there: MuJoCo's springs work both ways.
  const std::string law =
      band.both_ways ? fmt::format(" stiffness=\"{:.17g}\" damping=\"{:.17g}\" springlength=\"{:.17g}\"",
                                   band.stiffness, band.damping, rest)
                     : fmt::format(" limited=\"true\" range=\"-1 {:.17g}\"", rest);
  out.tendons += fixed_tendon(band.name, band.path, path, labels, law);
}

}  // namespace

MjcfTendons mjcf_tendons(const model::Model& model, const engine::Settings& settings,
                         const model::State& state) {
  MjcfTendons out;
  const std::vector<std::string> labels = coordinate_labels(model);
  if (settings.effects.has(model::Effect::muscles))
    for (const model::Muscle& muscle : model.muscles) add_muscle(muscle, state, labels, out);
  if (settings.effects.has(model::Effect::tendon_coupling))
    for (const model::Ligament& band : model.ligaments) add_band(band, state, labels, out);
  return out;
}

}  // namespace handsim::output
