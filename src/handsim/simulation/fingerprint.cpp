#include "handsim/simulation/fingerprint.h"

#include <cmath>
#include <set>

#ifdef __GLIBC__
#include <gnu/libc-version.h>
#endif

#include <fmt/format.h>

#include "handsim/control/motion_file.h"
#include "handsim/core/archive.h"

namespace handsim::simulation {

namespace {

/// Keys of a scene that its motion does not depend on, and those that the compiled settings stand for.
const std::set<std::string, std::less<>> kLeftOut = {"title",    "duration", "record", "pictures",
                                                     "criteria", "solver",   "effects"};

/// The motion does not depend on colours either, at any depth.
YamlNode without_colours(YamlNode node) {
  node.entries.remove_if([](const YamlEntry& entry) { return entry.key == "color"; });
  for (YamlEntry& entry : node.entries) entry.value = without_colours(std::move(entry.value));
  for (YamlNode& item : node.items) item = without_colours(std::move(item));
  return node;
}

/// One entry for each value of a map or list that stands at the top, one for each other value.
void add_parts(const YamlNode& resolved, Fingerprint& out) {
  const auto add = [&](const std::string& name, const YamlNode& node) {
    out.emplace_back(name, hash_bytes(emit_yaml(without_colours(node))));
  };
  for (const YamlEntry& entry : resolved.entries) {
    if (kLeftOut.contains(entry.key)) continue;
    const YamlNode& value = entry.value;
    for (const YamlEntry& inner : value.entries) add(entry.key + "." + inner.key, inner.value);
    for (std::size_t i = 0; i < value.items.size(); ++i)
      add(fmt::format("{}.{}", entry.key, i), value.items[i]);
    if (value.kind == YamlNode::Kind::scalar) add(entry.key, value);
  }
}

void add_settings(const engine::Settings& solver, Fingerprint& out) {
  const auto add = [&](std::string_view name, const auto& value) {
    ArchiveWriter bits;
    bits(value);
    out.emplace_back(fmt::format("solver.{}", name), hash_bytes(bits.bytes()));
  };
  each_setting(solver, [&]<class T>(std::string_view name, const T& value, const auto&...) {
    if constexpr (std::is_enum_v<T>)
      add(name, std::string(engine::name(engine::Method(value))));
    else if constexpr (requires { value.has_value(); })
      add(name, value ? Vec3(value->joint_gap, value->speed, value->angular_speed) : Vec3(Vec3::Zero()));
    else
      add(name, value);
  });
  add("step", solver.step);
  add("contact_forces", solver.contact_forces);
  for (int i = 0; i < model::kEffectCount; ++i) {
    const auto effect = static_cast<model::Effect>(i);
    if (solver.effects.has(effect)) out.emplace_back("effects." + std::string(model::name(effect)), 1);
  }
}

/// Enough arguments that two ways of rounding differ at many of them, and some tens of microseconds.
constexpr int kArguments = 500;

std::uint64_t results() {
  ArchiveWriter out;
  // The compiler must not know the arguments: it would work out the results itself.
  volatile double step = 0.0137;
  for (int i = 1; i <= kArguments; ++i) {
    const double x = step * i, below_one = std::fmod(x, 1.0);
    for (const double value : {std::sin(x), std::cos(x), std::tan(x), std::exp(x), std::log(x),
                               std::pow(x, 1.3), std::atan2(x, 2.7), std::asin(below_one),
                               std::acos(below_one), std::hypot(x, 1.7), std::atan(x), std::exp(-x)})
      out(value);
  }
  return hash_bytes(out.bytes());
}

std::string library() {
#ifdef __GLIBC__
  return fmt::format("glibc {}", gnu_get_libc_version());
#else
  return "unknown library";
#endif
}

}  // namespace

Fingerprint fingerprint(const scene::Scene& scene, const engine::Engine& engine) {
  Fingerprint out;
  // The articulated engine's version names an instruction set; all of them give the same bits.
  out.emplace_back(scene.spec.solver.engine() == engine::EngineKind::articulated
                       ? "engine articulated"
                       : "engine " + engine.version(),
                   1);
  out.emplace_back("the mathematics library (its version, or what this processor lets it use)",
                   hash_bytes(mathematics()));
  if (scene.spec.record_contacts) out.emplace_back("record.contacts", 1);
  add_settings(scene.spec.solver, out);
  // The scene names a mesh's file, not what is in it.
  for (const model::Shape& shape : scene.model.shapes) {
    if (!shape.mesh) continue;
    ArchiveWriter vertices;
    vertices.each(shape.mesh->vertices);
    out.emplace_back("mesh of " + shape.name, hash_bytes(vertices.bytes()));
  }
  for (const scene::ReferencedFile& file : scene.inputs)
    if (control::is_motion_file(file.copy)) out.emplace_back(file.copy, hash_bytes(*file.bytes));
  add_parts(scene::standalone(scene.resolved, scene.inputs), out);
  return out;
}

std::vector<std::string> differences(const Fingerprint& a, const Fingerprint& b) {
  const std::set<Fingerprint::value_type> in_a(a.begin(), a.end()), in_b(b.begin(), b.end());
  std::set<std::string> out;
  for (const auto& part : in_a)
    if (!in_b.contains(part)) out.insert(part.first);
  for (const auto& part : in_b)
    if (!in_a.contains(part)) out.insert(part.first);
  return {out.begin(), out.end()};
}

const std::string& mathematics() {
  static const std::string text =
      fmt::format("{}, results {:08x}", library(), static_cast<std::uint32_t>(results()));
  return text;
}

}  // namespace handsim::simulation
