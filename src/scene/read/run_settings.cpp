#include "handsim/scene/read/run_settings.h"

#include <cmath>

#include "handsim/scene/read/blocks.h"

namespace handsim::scene {

namespace {

void read_size(MapReader& reader, std::array<int, 2>& out) {
  const YamlNode* size = reader.list("size", false);
  if (!size) return;
  bool valid = size->items.size() == 2;
  for (std::size_t i = 0; valid && i < 2; ++i) {
    const auto pixels = parse_number(size->items[i].text);
    valid = pixels && *pixels >= 16 && *pixels <= 8192 && *pixels == std::floor(*pixels);
    if (valid) out[i] = static_cast<int>(*pixels);
  }
  if (!valid)
    reader.problem("size", size->described(), "[width, height] in pixels, whole numbers, 16 to 8192");
}

CameraSpec read_camera(MapReader camera) {
  CameraSpec spec;
  spec.position = camera.vector("position", kCoordinate);
  spec.target = camera.vector("target", kCoordinate, Vec3::Zero());
  spec.field_of_view = camera.number("field_of_view", {Dimension::angle, 0.01, 2.5}, 0.6);
  if (camera.sound() && (spec.position - spec.target).norm() < 1e-6)
    camera.problem("position", "the target itself", "a place apart from the target");
  camera.finish();
  return spec;
}

}  // namespace

void read_settings(MapReader& reader, model::SolverSettings& solver, bool or_auto) {
  std::vector<std::pair<std::string_view, model::EngineKind>> engines;
  for (const model::EngineKind kind :
       {model::EngineKind::ode, model::EngineKind::dae, model::EngineKind::articulated})
    engines.emplace_back(model::name(kind), kind);
  // Engine auto has given way to its choice by now: this is for the message.
  if (or_auto) engines.emplace_back("auto", model::EngineKind::ode);
  const model::EngineKind engine =
      reader.choice<model::EngineKind>("engine", engines, model::EngineKind::ode);
  std::vector<std::pair<std::string_view, model::Method>> methods;
  for (std::size_t i = 0; i < model::kMethodNames.size(); ++i)
    if (model::engine_of(static_cast<model::Method>(i)) == engine)
      methods.emplace_back(model::kMethodNames[i], static_cast<model::Method>(i));
  // The methods of an engine that is not known are not known either.
  if (!reader.sound())
    reader.child("method");
  else
    solver.method = reader.choice<model::Method>("method", methods, model::default_method(engine));
  solver.step = reader.number("step", {Dimension::time, 1e-6, 0.1}, 1e-3);
  solver.erp = reader.number("erp", {Dimension::none, 0, 1}, 0.2);
  solver.cfm = reader.number("cfm", {Dimension::none, 0, 1, true}, 1e-9);
  solver.iterations = reader.integer("iterations", 1, 100'000, 20);
  solver.projection = reader.flag("projection", false);
  if (solver.projection && engine != model::EngineKind::ode)
    reader.problem("projection", "true on engine " + std::string(model::name(engine)),
                   "false: its euler_projected and others close joints themselves");
  solver.tolerance = reader.number("tolerance", {Dimension::none, 1e-11, 1e-2}, 1e-9);
}

void read_solver(MapReader reader, model::SolverSettings& solver) {
  read_settings(reader, solver, true);
  solver.speculative = reader.flag("speculative", true);
  MapReader guard = reader.map("guard");
  const model::GuardLimits limits;
  solver.guard.joint_gap = guard.number("joint_gap", {Dimension::length, 1e-6, 1}, limits.joint_gap);
  solver.guard.speed = guard.number("speed", {Dimension::speed, 0.01, 1000}, limits.speed);
  solver.guard.angular_speed =
      guard.number("angular_speed", {Dimension::angular_speed, 1, 1e5}, limits.angular_speed);
  guard.finish();
  solver.seed = static_cast<std::uint64_t>(reader.integer("seed", 0, 2'147'483'647, 1));
  // Engine auto has taken its own by now.
  for (const char* key : {"accuracy", "costs"})
    if (reader.has(key))
      reader.problem(key, "a key of engine auto beside another engine", "engine: auto, or no such key");
  reader.finish();
}

PictureSpec read_pictures(MapReader reader) {
  PictureSpec out;
  read_size(reader, out.size);
  // A camera stands in place of a view.
  if (!reader.has("camera"))
    out.view = reader.choice<View>("view",
                                   {{"dorsal", View::dorsal},
                                    {"palmar", View::palmar},
                                    {"radial", View::radial},
                                    {"three_quarter", View::three_quarter}},
                                   View::three_quarter);
  else if (reader.has("view"))
    reader.problem("view", "a view beside a camera", "one of the two");
  if (reader.has("camera")) out.camera = read_camera(reader.map("camera"));
  out.floor = reader.flag("floor", true);
  out.joint_axes = reader.flag("joint_axes", false);
  out.contact_points = reader.flag("contact_points", false);
  out.contact_forces = reader.flag("contact_forces", false);
  reader.finish();
  return out;
}

}  // namespace handsim::scene
