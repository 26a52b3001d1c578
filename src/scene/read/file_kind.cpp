#include "handsim/scene/read/file_kind.h"

#include <array>

#include <fmt/format.h>

namespace handsim::scene {

namespace {

/// The key that only this kind has. Scenes first: they may hold the others.
struct Mark {
  const char* key;
  FileKind kind;
};
constexpr std::array kMarks = {Mark{"hands", FileKind::scene},         Mark{"objects", FileKind::scene},
                               Mark{"bodies", FileKind::scene},        Mark{"stature", FileKind::person},
                               Mark{"segments", FileKind::hand_model}, Mark{"fits", FileKind::anthropometry},
                               Mark{"gains", FileKind::controller},    Mark{"poses", FileKind::poses},
                               Mark{"methods", FileKind::study},       Mark{"shape", FileKind::object},
                               Mark{"parts", FileKind::object},        Mark{"norms", FileKind::grip_norms},
                               Mark{"cases", FileKind::stability},     Mark{"kinds", FileKind::costs},
                               Mark{"friction", FileKind::material}};

std::string_view keys_of(FileKind kind) {
  switch (kind) {
    case FileKind::scene:
      return "hands, effects, duration";
    case FileKind::person:
      return "stature, mass, sex";
    case FileKind::hand_model:
      return "anthropometry, palm, wrist, segments";
    case FileKind::anthropometry:
      return "fits, reference";
    case FileKind::controller:
      return "form, gains";
    case FileKind::poses:
      return "poses, programs";
    case FileKind::study:
      return "scene, reference, steps, methods";
    case FileKind::stability:
      return "cases";
    case FileKind::object:
      return "shape or parts, mass or density";
    case FileKind::grip_norms:
      return "source, norms";
    case FileKind::material:
      return "friction, stiffness, damping";
    case FileKind::costs:
      return "kinds";
  }
  return {};
}

}  // namespace

std::string_view described(FileKind kind) {
  switch (kind) {
    case FileKind::scene:
      return "a scene";
    case FileKind::person:
      return "a person";
    case FileKind::hand_model:
      return "a hand model";
    case FileKind::anthropometry:
      return "an anthropometry file";
    case FileKind::controller:
      return "a controller";
    case FileKind::poses:
      return "a pose file";
    case FileKind::study:
      return "an accuracy study";
    case FileKind::stability:
      return "a stability study";
    case FileKind::object:
      return "an object";
    case FileKind::grip_norms:
      return "a table of grip strength";
    case FileKind::material:
      return "a material";
    case FileKind::costs:
      return "a table of what accuracy costs";
  }
  return {};
}

std::optional<FileKind> kind_of(const YamlNode& root) {
  for (const Mark& mark : kMarks)
    if (root.find(mark.key)) return mark.kind;
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
      {root.place(), path, got, fmt::format("{}: a mapping with {}", described(wanted), keys_of(wanted))});
  return false;
}

}  // namespace handsim::scene
