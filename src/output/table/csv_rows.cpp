#include "handsim/output/table/csv_rows.h"

#include <fmt/format.h>

#include "handsim/core/index.h"

namespace handsim::output {

std::vector<std::string> coordinate_names(const model::Model& model) {
  std::vector<std::string> names;
  for (const model::Joint& joint : model.joints) {
    for (const model::JointAxis& axis : joint.axes) names.push_back(joint.name + "." + axis.name);
    if (joint.kind == model::JointKind::ball)
      for (const char* axis : {"x", "y", "z"}) names.push_back(joint.name + "." + axis);
  }
  return names;
}

std::string trajectory_head(const model::Model& model) {
  std::string out = "time[s]";
  const std::vector<std::string> names = coordinate_names(model);
  std::size_t dof = 0;
  std::string rates;
  for (const model::Joint& joint : model.joints)
    for (int i = 0; i < model::dof_count(joint.kind); ++i, ++dof) {
      const char* unit = joint.kind == model::JointKind::slider ? "m" : "rad";
      out += fmt::format(",{}[{}]", names[dof], unit);
      rates += fmt::format(",{}.rate[{}/s]", names[dof], unit);
    }
  out += rates;
  for (std::size_t b = 1; b < model.bodies.size(); ++b)
    out += fmt::format(",{0}.x[m],{0}.y[m],{0}.z[m],{0}.qw,{0}.qx,{0}.qy,{0}.qz", model.bodies[b].name);
  return out + "\n";
}

std::string trajectory_row(const model::State& state) {
  // Twelve digits hide the rounding errors of the time.
  std::string row = fmt::format("{:.12g}", state.time);
  const auto append = [&](double value) { fmt::format_to(std::back_inserter(row), ",{}", value); };
  for (const double q : state.q) append(q);
  for (const double u : state.u) append(u);
  for (std::size_t b = 1; b < state.bodies.size(); ++b) {
    const auto& [p, q, v, w] = state.bodies[b];
    for (const double value : {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()}) append(value);
  }
  return row + "\n";
}

std::string contact_head() {
  return "time[s],a,b,x[m],y[m],z[m],normal.x,normal.y,normal.z,depth[m],normal_force[N],friction.x[N],"
         "friction.y[N],friction.z[N]\n";
}

std::string contact_row(const model::Model& model, double time, const engine::Contact& contact) {
  const Vec3 &p = contact.position, &n = contact.normal, f = contact.friction_force();
  return fmt::format("{:.12g},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", time,
                     model.shapes[at(contact.shape_a)].name, model.shapes[at(contact.shape_b)].name, p.x(),
                     p.y(), p.z(), n.x(), n.y(), n.z(), contact.depth, contact.normal_force(), f.x(), f.y(),
                     f.z());
}

}  // namespace handsim::output
