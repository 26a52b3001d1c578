#include "handsim/output/table/csv_rows.h"

#include <fmt/format.h>

namespace handsim::output {

std::vector<std::string> coordinate_names(const model::Model& model) {
  std::vector<std::string> names;
  for (const model::Joint& joint : model.joints) {
    for (const model::JointAxis& axis : joint.axes) names.push_back(joint.name + "." + axis.name);
    if (joint.spherical())
      for (const char* axis : {"x", "y", "z"}) names.push_back(joint.name + "." + axis);
  }
  return names;
}

std::vector<std::string> trajectory_columns(const model::Model& model) {
  std::vector<std::string> out = {"time[s]"}, rates;
  const std::vector<std::string> names = coordinate_names(model);
  std::size_t dof = 0;
  for (const model::Joint& joint : model.joints)
    for (int i = 0; i < model::dof_count(joint.kind); ++i, ++dof) {
      const char* unit = joint.unit(as_index(i));
      out.push_back(fmt::format("{}[{}]", names[dof], unit));
      rates.push_back(fmt::format("{}.rate[{}/s]", names[dof], unit));
    }
  out.insert(out.end(), rates.begin(), rates.end());
  for (std::size_t b = 1; b < model.bodies.size(); ++b)
    for (const char* part : {".x[m]", ".y[m]", ".z[m]", ".qw", ".qx", ".qy", ".qz"})
      out.push_back(model.bodies[b].name + part);
  return out;
}

std::vector<double> trajectory_values(const model::State& state) {
  std::vector<double> out = {state.time};
  out.insert(out.end(), state.q.begin(), state.q.end());
  out.insert(out.end(), state.u.begin(), state.u.end());
  for (std::size_t b = 1; b < state.bodies.size(); ++b) {
    const auto& [p, q, v, w] = state.bodies[b];
    out.insert(out.end(), {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
  }
  return out;
}

std::string contact_head() {
  return "time[s],a,b,x[m],y[m],z[m],normal.x,normal.y,normal.z,depth[m],normal_force[N],friction.x[N],"
         "friction.y[N],friction.z[N]\n";
}

std::string contact_row(const model::Model& model, double time, const engine::Contact& contact) {
  const Vec3 &p = contact.position, &n = contact.normal, f = contact.friction_force();
  return fmt::format("{:.12g},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", time,
                     model.shapes[as_index(contact.shape_a)].name,
                     model.shapes[as_index(contact.shape_b)].name, p.x(), p.y(), p.z(), n.x(), n.y(), n.z(),
                     contact.depth, contact.normal_force(), f.x(), f.y(), f.z());
}

}  // namespace handsim::output
