#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "handsim/model/muscle_curves.h"
#include "handsim/output/export/export_tree.h"

namespace handsim::output {

namespace {

using Powers = std::vector<int>;  ///< Powers of the variables of a term.

/// A tendon's length as a polynomial of the coordinates that move.
struct Polynomial {
  std::vector<int> dofs;  ///< of the variables
  std::map<Powers, double> terms;
};

/// Whether a coordinate is one of the exported file: joints of kinematic bodies are welded.
std::vector<bool> moving_coordinates(const model::Model& model) {
  std::vector<bool> out(as_index(model.dof_count()));
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      out[as_index(joint.first_dof) + a] = !model.bodies[as_index(joint.child)].kinematic;
  return out;
}

/// Length at zero coordinates less the excursion.
Polynomial length_of(const model::TendonPath& path, double length, const std::vector<bool>& moves,
                     const model::State& start) {
  Polynomial out;
  std::vector<int> variable;
  for (const model::MomentArm& arm : path.arms) {
    variable.push_back(moves[as_index(arm.dof)] ? static_cast<int>(out.dofs.size()) : -1);
    if (moves[as_index(arm.dof)]) out.dofs.push_back(arm.dof);
  }
  // A term of up to two arms; that of a welded coordinate is a number.
  const auto subtract = [&](double factor, std::initializer_list<std::pair<std::size_t, int>> of) {
    Powers powers(out.dofs.size(), 0);
    for (const auto& [arm, power] : of) {
      if (variable[arm] < 0)
        factor *= std::pow(start.q[as_index(path.arms[arm].dof)], power);
      else
        powers[as_index(variable[arm])] = power;
    }
    out.terms[powers] -= factor;
  };
  subtract(-length, {});
  for (std::size_t i = 0; i < path.arms.size(); ++i)
    for (int k = 0; k < model::kArmTerms; ++k)
      if (path.arms[i].c[as_index(k)] != 0) subtract(path.arms[i].c[as_index(k)] / (k + 1), {{i, k + 1}});
  for (const model::ArmProduct& each : path.products)
    subtract(each.factor, {{as_index(each.a), each.power_a}, {as_index(each.b), each.power_b}});
  return out;
}

/// Coefficients in OpenSim's order: all powers whose sum is at most `left`, the last variable's first.
void add_coefficients(const Polynomial& length, Powers& powers, std::size_t variable, int left,
                      std::string& out) {
  if (variable == powers.size()) {
    const auto found = length.terms.find(powers);
    out += fmt::format("{}{:.17g}", out.empty() ? "" : " ", found == length.terms.end() ? 0 : found->second);
    return;
  }
  for (int power = 0; power <= left; ++power) {
    powers[variable] = power;
    add_coefficients(length, powers, variable + 1, left - power, out);
  }
  powers[variable] = 0;
}

std::string path_element(const Polynomial& length, const std::vector<std::string>& places) {
  int order = 0;
  for (const auto& [powers, factor] : length.terms) {
    int sum = 0;
    for (const int power : powers) sum += power;
    order = std::max(order, sum);
  }
  std::string coordinates, coefficients;
  for (const int dof : length.dofs) coordinates += (coordinates.empty() ? "" : " ") + places[as_index(dof)];
  Powers powers(length.dofs.size(), 0);
  add_coefficients(length, powers, 0, order, coefficients);
  return fmt::format(
      "<FunctionBasedPath "
      "name=\"path\">{}<length_function><MultivariatePolynomialFunction>{}<dimension>{}</"
      "dimension><order>{}</order></MultivariatePolynomialFunction></length_function></FunctionBasedPath>",
      element("coordinate_paths", coordinates), element("coefficients", coefficients), length.dofs.size(),
      order);
}

std::string curve(const char* name, const std::string& expression) {
  return fmt::format("<ExpressionBasedFunction name=\"{}\">{}{}</ExpressionBasedFunction>", name,
                     element("expression", expression), element("variables", "x"));
}

/// The curves of muscle_curves.h; that of the speed at full activation.
std::string curves() {
  using namespace model::hill;
  const double grown = std::exp(kPassiveShape), scale = std::expm1(kPassiveShape);
  const double end = 1 + kPassiveStrain, slope = kPassiveShape / kPassiveStrain * grown / scale;
  return curve("active_force_length_curve",
               fmt::format("exp(-(x-1)^2/{:.17g})*step(x-{:.17g})*step({:.17g}-x)", kActiveWidth, kShortest,
                           kLongest)) +
         curve("passive_force_length_curve", fmt::format("step(x-1)*((exp({0:.17g}*(min(x,{2:.17g})-1)/"
                                                         "{1:.17g})-1)/{3:.17g}+{4:.17g}*max(0,x-{2:.17g}))",
                                                         kPassiveShape, kPassiveStrain, end, scale, slope)) +
         curve("force_velocity_curve", fmt::format("(1+max(-1,min(x,0)))/(1-max(-1,min(x,0))/"
                                                   "{2:.17g})+(1+{0:.17g}*max(x,0))/(1+{1:.17g}*max(x,0))-1",
                                                   kSteep * kLengthening, kSteep, kSpeedShape));
}

std::string muscle_element(const model::Muscle& muscle, const std::string& path) {
  return fmt::format("<RigidTendonMuscle name=\"{}\">", attribute(muscle.name)) +
         element("min_control", 0.0) + element("max_control", muscle.excitable) + path +
         element("max_isometric_force", muscle.force) + element("optimal_fiber_length", muscle.fibre_length) +
         element("tendon_slack_length", muscle.slack_length) +
         element("pennation_angle_at_optimal", muscle.pennation) +
         element("max_contraction_velocity", muscle.max_speed) + element("ignore_tendon_compliance", "true") +
         element("ignore_activation_dynamics", "true") + curves() + "</RigidTendonMuscle>\n";
}

/// A slack band's stretch is clamped at zero, where it has no force even while it gets longer.
std::string band_element(const model::Band& band, const std::string& path) {
  const std::string pull = fmt::format("{:.17g}*s+{:.17g}*ldot", band.stiffness, band.damping);
  return fmt::format("<ExpressionBasedPathForce name=\"{}\">", attribute(band.name)) + path +
         element("resting_length", band.rest) +
         element("expression", band.both_ways ? pull : "(1-step(-s))*max(0," + pull + ")") +
         element("clamp_stretch", band.both_ways ? "false" : "true") + "</ExpressionBasedPathForce>\n";
}

}  // namespace

std::string osim_muscles(const model::Model& model, const engine::Settings& settings,
                         const model::State& start) {
  const std::vector<bool> moves = moving_coordinates(model);
  std::vector<std::string> places(as_index(model.dof_count()));
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      places[as_index(joint.first_dof) + a] =
          attribute(fmt::format("/jointset/{0}/{0}.{1}", joint.name, joint.axes[a].name));
  std::string out;
  // OpenSim has no path that depends on no coordinate.
  if (settings.effects.has(model::Effect::muscles))
    for (const model::Muscle& muscle : model.muscles)
      if (const Polynomial length = length_of(muscle.path, muscle.length, moves, start); !length.dofs.empty())
        out += muscle_element(muscle, path_element(length, places));
  if (settings.effects.has(model::Effect::tendon_coupling))
    for (const model::Band& band : model.bands)
      if (const Polynomial length = length_of(band.path, 0, moves, start); !length.dofs.empty())
        out += band_element(band, path_element(length, places));
  return out;
}

}  // namespace handsim::output
