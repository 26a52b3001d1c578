#include "handsim/output/export/mjcf_parts.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "handsim/core/index.h"
#include "handsim/engine/collision/pair_table.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/export/export_tree.h"

namespace handsim::output {

namespace {

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

/// What MuJoCo makes of two surfaces by itself.
bool combined_there(const model::Material& a, const model::Material& b, const model::Material& pair,
                    bool friction) {
  if (pair.compliance) return false;
  return !friction || (pair.friction == std::max(a.friction, b.friction) &&
                       pair.rolling_friction == std::max(a.rolling_friction, b.rolling_friction) &&
                       pair.spinning_friction == std::max(a.spinning_friction, b.spinning_friction));
}

}  // namespace

std::vector<double> mobilities(const model::Model& model) {
  const std::vector<double> zeros(at(model.dof_count()));
  const model::State state = model::state_at(model, zeros);
  const std::vector<int> free = model::free_bodies(model);
  std::vector<int> bodies(model.bodies.size());
  std::iota(bodies.begin(), bodies.end(), 0);
  // Semidefinite: a joint that closes a loop has columns of zeros.
  const auto factor = model::mass_matrix(model, state, bodies, free).ldlt();
  std::vector<double> out;
  for (const int body : bodies) {
    const Eigen::MatrixXd J =
        model::jacobian(model, state, body, state.bodies[at(body)].p, free).topRows<3>();
    out.push_back((J * factor.solve(J.transpose())).trace() / 3);
  }
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
  std::string out;
  for (std::size_t i = 0; i < model.shapes.size(); ++i)
    for (std::size_t j = i + 1; j < model.shapes.size(); ++j) {
      const model::Shape &a = model.shapes[i], &b = model.shapes[j];
      if (!rules.meet(a.group, b.group) || untested(a.body, b.body)) continue;
      const model::Material pair = rules.between(a, b);
      if (combined_there(model.materials[at(a.material)], model.materials[at(b.material)], pair, friction))
        continue;
      out += fmt::format("    <pair geom1=\"{}\" geom2=\"{}\"{}", attribute(a.name), attribute(b.name),
                         mjcf_friction(pair, settings, true));
      if (pair.compliance) {
        if (mobility.empty()) mobility = mobilities(model);
        out += spring_damper(*pair.compliance, mobility[at(a.body)] + mobility[at(b.body)], settings.step);
      }
      out += "/>\n";
    }
  return out;
}

}  // namespace handsim::output
