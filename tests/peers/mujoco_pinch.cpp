// A pinch in MuJoCo: two pads on slides, each pushed against an object by a constant force, hold it against
// gravity by friction. Reads a request from standard input (JSON, SI): `shape` (box, sphere, capsule,
// cylinder), `mass`, `friction`, `force` on each pad, `step`, `settle` and `hold` [s], `option` (attributes
// of MuJoCo's <option>). Answers with `version`, `slip` [m/s], the object's mean speed of fall over the hold,
// and `tilt` [rad], its turn over the hold.
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

#include <nlohmann/json.hpp>

#include "mujoco_model.h"

namespace {

using mujoco::Free;
using Json = nlohmann::json;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

/// Capsules and cylinders lie along y; sizes as in pinch_test.cpp.
std::string object_geom(const std::string& shape) {
  if (shape == "box") return "type='box' size='0.02 0.02 0.02'";
  if (shape == "sphere") return "type='sphere' size='0.02'";
  const std::string along = "size='0.02 0.02' euler='1.5707963267948966 0 0'";
  if (shape == "capsule") return "type='capsule' " + along;
  if (shape == "cylinder") return "type='cylinder' " + along;
  throw std::runtime_error("no shape " + shape);
}

std::string pad(const std::string& name, double x, const std::string& friction) {
  return "<body name='" + name + "' pos='" + number(x) + " 0 0.5'><joint name='" + name +
         "' type='slide' axis='1 0 0'/><geom type='box' size='0.01 0.03 0.03' mass='0.05' " + friction +
         "/></body>";
}

std::string model_text(const Json& request) {
  const std::string friction = "condim='3' friction='" + number(request.at("friction")) + " 0.005 0.0001'";
  std::string option = "<option timestep='" + number(request.at("step")) + "' gravity='0 0 -9.80665'";
  for (const auto& [key, value] : request.at("option").items())
    option += " " + key + "='" + value.get<std::string>() + "'";
  return "<mujoco><compiler angle='radian'/>" + option + "/><worldbody>" + pad("left", -0.03, friction) +
         pad("right", 0.03, friction) + "<body name='object' pos='0 0 0.5'><freejoint/><geom " +
         object_geom(request.at("shape")) + " mass='" + number(request.at("mass")) + "' " + friction +
         "/></body></worldbody></mujoco>";
}

Json pinch(const Json& request) {
  const std::unique_ptr<mjModel, Free> model = mujoco::compile(model_text(request));
  const std::unique_ptr<mjData, Free> data(mj_makeData(model.get()));
  const auto dof = [&](const char* name) {
    return model->jnt_dofadr[mj_name2id(model.get(), mjOBJ_JOINT, name)];
  };
  const double force = request.at("force");
  data->qfrc_applied[dof("left")] = force;
  data->qfrc_applied[dof("right")] = -force;
  const int first = model->jnt_qposadr[model->body_jntadr[mj_name2id(model.get(), mjOBJ_BODY, "object")]];
  const auto run = [&](double time) {
    const long steps = std::lround(time / model->opt.timestep);
    for (long i = 0; i < steps; ++i) mj_step(model.get(), data.get());
  };
  run(request.at("settle"));
  const double height = data->qpos[first + 2];
  mjtNum before[4];
  mju_copy4(before, data->qpos + first + 3);
  const double hold = request.at("hold");
  run(hold);
  mjtNum turn[3];
  mju_subQuat(turn, data->qpos + first + 3, before);
  return {{"version", mj_versionString()},
          {"slip", (height - data->qpos[first + 2]) / hold},
          {"tilt", mju_norm3(turn)}};
}

}  // namespace

int main() {
  mujoco::report_on_standard_error();
  try {
    std::cout << pinch(Json::parse(std::cin)).dump() << "\n";
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
