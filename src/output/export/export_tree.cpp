#include "handsim/output/export/export_tree.h"

#include <fmt/format.h>

namespace handsim::output {

std::vector<std::vector<int>> children_of(const model::Model& model) {
  std::vector<std::vector<int>> out(model.bodies.size());
  for (std::size_t i = 0; i < model.joints.size(); ++i)
    if (!model.joints[i].closes_loop)
      out[static_cast<std::size_t>(model.joints[i].parent)].push_back(static_cast<int>(i));
  return out;
}

std::vector<int> holder_of(const model::Model& model) {
  std::vector<int> out(model.bodies.size(), -1);
  for (std::size_t i = 0; i < model.joints.size(); ++i)
    if (!model.joints[i].closes_loop)
      out[static_cast<std::size_t>(model.joints[i].child)] = static_cast<int>(i);
  return out;
}

std::string numbers(const Vec3& v) { return fmt::format("{:.17g} {:.17g} {:.17g}", v.x(), v.y(), v.z()); }

std::string wxyz(const Quat& q) {
  return fmt::format("{:.17g} {:.17g} {:.17g} {:.17g}", q.w(), q.x(), q.y(), q.z());
}

std::string attribute(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '"')
      out += "&quot;";
    else
      out += c;
  }
  return out;
}

}  // namespace handsim::output
