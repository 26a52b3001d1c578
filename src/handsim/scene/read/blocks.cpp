#include "handsim/scene/read/blocks.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace handsim::scene {

std::string item_path(std::string_view list, std::size_t i) { return fmt::format("{}.{}", list, i); }

Pose read_pose(MapReader& reader, std::optional<Vec3> fallback) {
  Pose pose;
  pose.p = reader.vector("position", kCoordinate, std::move(fallback));
  pose.q = reader.rotation("rotation");
  return pose;
}

const YamlNode* referenced(MapReader& reader, std::string_view key, FileKind kind, bool required,
                           const std::string& otherwise) {
  const YamlNode* node = reader.file_or_block(key, described(kind), required, otherwise);
  return node && is_of_kind(*node, reader.path_of(key), kind, reader.diagnostics()) ? node : nullptr;
}

bool inline_file(MapReader& block, FileKind kind,
                 bool (*overridden)(const YamlNode& entry, const std::string& key)) {
  Diagnostics& diagnostics = block.diagnostics();
  if (!block.has("file")) return true;
  const YamlNode* file = block.value("file", {{YamlNode::Kind::scalar}, "the path of its file"});
  if (!file) return false;
  const std::string key = block.path_of("file");
  YamlNode content = *file;
  try {
    follow_reference(content, key, diagnostics.budget);
  } catch (const Error& error) {
    diagnostics.add(error);
    return false;
  }
  if (!is_of_kind(content, key, kind, diagnostics)) return false;
  YamlNode own = block.node();
  own.entries.remove_if([](const YamlEntry& of) { return of.key == "file"; });
  YamlNode both = own;
  for (YamlEntry& of : content.entries)
    if (!overridden(own, of.key)) both.entries.push_back(std::move(of));
  block.read_instead(std::move(both));
  return true;
}

namespace {

struct Row {
  FileKind kind;
  std::string_view name;
  std::string_view keys;                  ///< for messages
  std::array<std::string_view, 3> marks;  ///< keys that only this kind has
};

/// Scenes first, because they may contain the others; materials last, because objects also have `friction`.
constexpr std::array<Row, 17> kRows = {{
    {FileKind::scene, "a scene", "hands, effects, duration", {"hands", "objects", "bodies"}},
    {FileKind::person, "a person", "stature, mass, sex", {"stature"}},
    {FileKind::hand_model, "a hand model", "anthropometry, palm, wrist, segments", {"segments", "based_on"}},
    {FileKind::anthropometry, "an anthropometry file", "fits, reference", {"fits"}},
    {FileKind::controller, "a controller", "form, gains", {"gains"}},
    {FileKind::poses, "a pose file", "poses, programs", {"poses"}},
    {FileKind::study, "an accuracy study", "scene, reference, steps, methods", {"methods"}},
    {FileKind::object, "an object", "shape or parts, mass or density", {"shape", "parts"}},
    {FileKind::muscles, "muscles of a hand", "reference, norms, muscles", {"muscles"}},
    {FileKind::measurements, "a table of measurements", "hand, people, measurements", {"measurements"}},
    {FileKind::grip_norms, "a table of grip strength", "source, norms", {"norms"}},
    {FileKind::stability, "a stability study", "cases", {"cases"}},
    {FileKind::rollouts, "a rollout study", "scene, vary, count", {"vary"}},
    {FileKind::motion_names, "names of a motion file", "columns, couplings", {"columns", "couplings"}},
    {FileKind::marker_set, "a marker set", "markers, sensors, points", {"markers", "sensors", "points"}},
    {FileKind::costs, "a table of what accuracy costs", "kinds", {"kinds"}},
    {FileKind::material, "a material", "friction, stiffness, damping", {"friction"}},
}};

const Row& row_of(FileKind kind) {
  return *std::ranges::find_if(kRows, [&](const Row& row) { return row.kind == kind; });
}

}  // namespace

std::string_view described(FileKind kind) { return row_of(kind).name; }

std::optional<FileKind> kind_of(const YamlNode& root) {
  for (const Row& row : kRows)
    for (const std::string_view mark : row.marks)
      if (!mark.empty() && root.find(mark)) return row.kind;
  return std::nullopt;
}

bool is_of_kind(const YamlNode& root, const std::string& path, FileKind wanted, Diagnostics& diagnostics) {
  const std::optional<FileKind> kind = kind_of(root);
  if (root.kind == YamlNode::Kind::map && kind.value_or(wanted) == wanted) return true;
  const bool empty_file = root.kind == YamlNode::Kind::null && path.empty();
  const std::string got = kind         ? std::string(described(*kind))
                          : empty_file ? "an empty file"
                                       : root.described();
  diagnostics.problems.push_back(
      {root.place(), path, got,
       fmt::format("{}: a mapping with {}", described(wanted), row_of(wanted).keys)});
  return false;
}

}  // namespace handsim::scene
