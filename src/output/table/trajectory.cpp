#include "handsim/output/table/trajectory.h"

#include <iterator>

#include <fmt/format.h>

namespace handsim::output {

namespace {

void append(std::string& out, double value) {
  out += ',';
  fmt::format_to(std::back_inserter(out), "{}", value);
}

std::string header(const model::Model& model) {
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

}  // namespace

std::vector<std::string> coordinate_names(const model::Model& model) {
  std::vector<std::string> names;
  for (const model::Joint& joint : model.joints) {
    for (const model::JointAxis& axis : joint.axes) names.push_back(joint.name + "." + axis.name);
    if (joint.kind == model::JointKind::ball)
      for (const char* axis : {"x", "y", "z"}) names.push_back(joint.name + "." + axis);
  }
  return names;
}

TrajectoryWriter::TrajectoryWriter(const std::filesystem::path& path, const model::Model& model)
    : file_(path) {
  file_.write(header(model));
}

void TrajectoryWriter::add(const model::State& state) {
  // Twelve digits: sums of steps carry rounding that nobody wants to read.
  std::string row = fmt::format("{:.12g}", state.time);
  for (const double q : state.q) append(row, q);
  for (const double u : state.u) append(row, u);
  for (std::size_t b = 1; b < state.bodies.size(); ++b) {
    const model::BodyState& body = state.bodies[b];
    for (const double value :
         {body.p.x(), body.p.y(), body.p.z(), body.q.w(), body.q.x(), body.q.y(), body.q.z()})
      append(row, value);
  }
  file_.write(row + "\n");
}

void TrajectoryWriter::finish() { file_.commit(); }

}  // namespace handsim::output
