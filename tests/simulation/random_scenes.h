// Draws scenes far from sensible: steps of 20 ms, objects of 1 g beside 10 kg, things inside each other, at
// 20 m/s, chains that spin, and every engine and method, for the smooth ones without what they refuse, or
// else to be refused.
#pragma once

#include <fmt/format.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include "scene_files.h"
#include "support/sanitized.h"

namespace handsim::test::drawn {

/// One of low to high - 1. rapidcheck by itself would draw from a range that grows with the tests.
inline int integer(int low, int high) {
  return *rc::gen::resize(rc::kNominalSize, rc::gen::inRange(low, high));
}

/// Uniform in a range.
inline double number(double low, double high) {
  constexpr int kParts = 10'000;
  return low + (high - low) * integer(0, kParts + 1) / kParts;
}

/// Uniform in its logarithm.
inline double scale(double low, double high) { return std::exp(number(std::log(low), std::log(high))); }

inline std::string vector(double size) {
  return fmt::format("[{:.4g}, {:.4g}, {:.4g}]", number(-size, size), number(-size, size),
                     number(-size, size));
}

inline std::string one_of(std::vector<std::string> words) { return *rc::gen::elementOf(std::move(words)); }

inline std::string hand(int index, const std::string& model) {
  const std::string person = one_of({"child", "giant", "large_man", "small_woman", "median_man"});
  const std::string mount = one_of({"fixed", "free"});
  return fmt::format(
      "{{model: {}, person: {}, side: {}, wrist: {{mount: {}, position: [{:.3g}, 0, {:.3g}], rotation: "
      "{{axis: [{:.3g}, 1, "
      "{:.3g}], angle: {:.3g}}}}}}}",
      source("handmodels/" + model + ".yaml").string(), source("config/persons/" + person + ".yaml").string(),
      one_of({"right", "left"}), mount, 0.15 * index + number(-0.05, 0.05), number(0, 0.3), number(-1, 1),
      number(-1, 1), number(-3, 3));
}

inline std::string object(int index) {
  const std::string shape = one_of({"sphere", "box", "cylinder", "capsule"});
  std::string size;
  if (shape == "sphere")
    size = fmt::format("radius: {:.4g}", scale(3e-3, 0.1));
  else if (shape == "box")
    size =
        fmt::format("edges: [{:.4g}, {:.4g}, {:.4g}]", scale(5e-3, 0.2), scale(5e-3, 0.2), scale(5e-3, 0.2));
  else
    size = fmt::format("radius: {:.4g}, length: {:.4g}", scale(3e-3, 0.05), scale(5e-3, 0.2));
  return fmt::format(
      "{{name: thing{}, shape: {}, {}, mass: {:.4g}, position: {}, velocity: {}, restitution: {:.2g}, "
      "friction: "
      "{:.3g}, overlap: allowed}}",
      index, shape, size, scale(1e-3, 10), vector(0.2), vector(scale(0.01, 20)), number(0, 1), number(0, 3));
}

template <class Make>
std::string list(int least, int most, Make make) {
  std::string out;
  for (int i = integer(least, most + 1); i > 0; --i) out += (out.empty() ? "" : ", ") + make(i);
  return "[" + out + "]";
}

/// A chain of bodies that hangs on the origin by a ball joint and spins as one: the joints are of any kind.
inline std::string chain() {
  const int count = integer(1, 5);
  const Vec3 w(number(-20, 20), number(-20, 20), number(-20, 20));
  std::string bodies, joints;
  for (int i = 0; i < count; ++i) {
    const double mass = scale(1e-3, 10), length = 0.1;
    const Vec3 at(0, length * (i + 0.5), 0), v = w.cross(at);
    bodies += fmt::format(
        "{{name: link{}, mass: {:.4g}, inertia: [{:.4g}, {:.4g}, {:.4g}], position: [0, {:.4g}, 0], "
        "velocity: [{:.17g}, {:.17g}, {:.17g}], angular_velocity: [{:.17g}, {:.17g}, {:.17g}]}}, ",
        i, mass, mass * 1e-3, mass * 4e-4, mass * 1e-3, at.y(), v.x(), v.y(), v.z(), w.x(), w.y(), w.z());
    const std::string kind = i == 0 ? "ball" : one_of({"ball", "hinge", "universal", "slider"});
    std::string axes;
    if (kind == "hinge" || kind == "slider") axes = ", axes: [{name: a, axis: " + vector(1) + "}]";
    if (kind == "universal") axes = ", axes: [{name: a, axis: [1, 0, 0]}, {name: b, axis: [0, 0.6, 0.8]}]";
    joints +=
        fmt::format("{{name: pin{}, type: {}, parent: {}, child: link{}, position: [0, {:.4g}, 0]{}}}, ", i,
                    kind, i == 0 ? "world" : fmt::format("link{}", i - 1), i, length * i, axes);
  }
  return "bodies: [" + bodies + "]\njoints: [" + joints + "]\n";
}

struct Drawn {
  std::string method;
  bool refused = false;  ///< asks a method for contact that has none
  std::string text;
};

/// A fixed seed, unless another is asked for: RC_PARAMS="seed=7" test_simulation --gtest_filter=RandomScenes*
inline void fix_seed() {
  setenv("RC_PARAMS", fmt::format("seed=20261122 max_success={}", kDrawnCases).c_str(), 0);
  std::cout << "RC_PARAMS=\"" << std::getenv("RC_PARAMS") << "\"\n";
}

inline Drawn random_scene() {
  Drawn out;
  out.method = one_of({"world_step", "quick_step", "semi_implicit_euler", "rk4", "dormand_prince",
                       "stabilised_gear", "lagrange_penalty", "euler_linearised", "euler_projected"});
  const auto is = [&](std::initializer_list<const char*> names) {
    return std::find(names.begin(), names.end(), out.method) != names.end();
  };
  const bool ode = is({"world_step", "quick_step"});
  const bool articulated = is({"semi_implicit_euler", "rk4", "dormand_prince"});
  const bool smooth = !ode && out.method != "semi_implicit_euler";
  out.refused = smooth && integer(0, 10) == 0;
  const std::string model = one_of({"anatomical", "prototype"});
  const bool content = !smooth || out.refused;
  const std::string hands = list(smooth ? 1 : 0, 2, [&](int i) { return hand(i, model); });
  // A hand's tissue and gravity are smooth; stops and contact are not.
  const std::string effects =
      content ? "auto" : (model == "anatomical" ? "[gravity, passive_tissue]" : one_of({"[gravity]", "[]"}));
  out.text = fmt::format(
      "title: drawn\nhands: {}\n{}{}{}effects: {}\n"
      "solver: {{engine: {}, method: {}, step: {:.4g}, erp: {:.3g}, {}}}\nduration: 0.1\n",
      hands, content ? "objects: " + list(1, 3, object) + "\n" : "", integer(0, 3) == 0 ? chain() : "",
      content && *rc::gen::arbitrary<bool>() ? "ground: {height: -0.1}\n" : "", effects,
      ode ? "ode" : (articulated ? "articulated" : "dae"), out.method, scale(5e-4, 0.02), number(0, 1),
      ode ? fmt::format("cfm: {:.3g}, iterations: {}, projection: {}, seed: {}", scale(1e-10, 1e-3),
                        integer(1, 100), one_of({"false", "false", "true"}), integer(0, 1000))
          : fmt::format("tolerance: {:.3g}", scale(1e-8, 1e-3)));
  return out;
}

}  // namespace handsim::test::drawn
