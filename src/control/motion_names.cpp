#include "handsim/control/motion_names.h"

#include <cmath>

namespace handsim::control {

namespace {

const Quantity kOffset = {Dimension::angle, -2 * M_PI, 2 * M_PI};
constexpr std::size_t kMostNames = 1000;

/// `index_mcp.flexion`, or a mapping with sign and offset.
ColumnName read_column(MapReader& columns, const std::string& name) {
  using Kind = YamlNode::Kind;
  ColumnName out;
  YamlNode* node = columns.value(
      name, {{Kind::scalar, Kind::map}, "an axis such as index_mcp.flexion, or {axis, sign, offset}"});
  if (!node) return out;
  if (node->kind == Kind::scalar) {
    out.axis = node->text;
    return out;
  }
  MapReader column = columns.map(name);
  out.axis = column.text("axis");
  out.sign = column.number("sign", {Dimension::none, -1, 1}, 1.0);
  if (std::abs(out.sign) != 1) column.problem("sign", number_text(out.sign), "1 or -1");
  out.offset = column.number("offset", kOffset, 0.0);
  column.finish();
  return out;
}

Coupling read_coupling(MapReader coupling) {
  Coupling out;
  out.axis = coupling.text("axis");
  out.ratio = coupling.number("ratio", {Dimension::none, -10, 10}, 1.0);
  out.offset = coupling.number("offset", kOffset, 0.0);
  coupling.finish();
  return out;
}

}  // namespace

MotionNames read_motion_names(YamlNode& node, const std::string& path, Diagnostics& diagnostics) {
  MotionNames out;
  MapReader reader(node, path, diagnostics);
  reader.text("title", "untitled");
  reader.named_texts("sources");
  MapReader columns = reader.map("columns");
  for (const std::string& name : columns.keys(kMostNames)) out.columns[name] = read_column(columns, name);
  columns.finish();
  MapReader couplings = reader.map("couplings");
  for (const std::string& name : couplings.keys(kMostNames))
    out.couplings[name] = read_coupling(couplings.required_map(name, "{axis, ratio, offset}"));
  couplings.finish();
  reader.finish();
  return out;
}

}  // namespace handsim::control
