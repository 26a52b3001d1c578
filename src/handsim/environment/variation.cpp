#include "handsim/environment/variation.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/environment/draws.h"
#include "handsim/simulation/simulation.h"

namespace handsim::environment {

namespace {

constexpr std::string_view kNames =
    "gravity, gains, torque_limits, q, objects.I.mass, objects.I.friction, objects.I.position";

[[noreturn]] void refuse(std::string_view name, std::string got, std::string need) {
  throw input_error(std::string(name), std::move(got), std::move(need));
}

}  // namespace

Variation::Variation(scene::Scene& scene) : scene_(&scene) {
  for (std::size_t i = 0; i < scene.model.objects.size(); ++i) {
    Object& object = objects_.emplace_back();
    object.position = object.own_position = scene.plans.objects[i].pose.p;
    if (const std::optional<int> body = scene.model.objects[i].body) {
      object.mass = scene.model.bodies[as_index(*body)].mass;
      object.inertia = scene.model.bodies[as_index(*body)].inertia;
    }
  }
  if (scene.control)
    for (const control::DrivenAxis& axis : scene.control->axes) axes_.push_back(axis);
  q_.resize(as_index(scene.model.dof_count()));
}

/// The index I in a name `objects.I.KEY`. @param key set to KEY
std::size_t Variation::object_index(std::string_view name, std::string_view& key) const {
  constexpr std::string_view kFirst = "objects.";
  std::size_t index = 0;
  const char* end = name.data() + name.size();
  const bool of_object = name.starts_with(kFirst);
  const auto [rest, error] =
      std::from_chars(name.data() + (of_object ? kFirst.size() : name.size()), end, index);
  if (!of_object || error != std::errc() || rest == end || *rest != '.')
    refuse("vary", std::string(name), fmt::format("one of {}", kNames));
  key = std::string_view(rest + 1, end);
  if (index >= objects_.size())
    refuse(name, fmt::format("object {}", index),
           fmt::format("one of the scene's {} objects", objects_.size()));
  if (key != "mass" && key != "friction" && key != "position")
    refuse("vary", std::string(name), fmt::format("one of {}", kNames));
  if (key != "friction" && !scene_->model.objects[index].body)
    refuse(name, "an object that is static", "one that can move");
  return index;
}

std::size_t Variation::material_of(std::size_t object) const {
  return as_index(scene_->model.shapes[as_index(scene_->model.objects[object].shapes.front())].material);
}

std::size_t Variation::size_of(std::string_view name) const {
  if (name == "gravity" || name.ends_with(".position")) return 3;
  return name == "q" ? q_.size() : 1;
}

void Variation::set(std::string_view name, std::span<const double> values) {
  if (values.size() != size_of(name))
    refuse(name, fmt::format("{} numbers", values.size()), fmt::format("{}", size_of(name)));
  if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); }))
    refuse(name, fmt::format("{}", fmt::join(values, ", ")), "finite numbers");
  if (name == "gravity") {
    scene_->model.gravity = {values[0], values[1], values[2]};
    if (scene_->control && scene_->control->gravity) scene_->control->gravity = scene_->model.gravity;
    changed_ = true;
  } else if (name == "gains" || name == "torque_limits") {
    if (!scene_->control) refuse(name, "a scene that drives no joint", "one with control");
    if (!(values[0] > 0)) refuse(name, fmt::format("{:g}", values[0]), "a factor above 0");
    (name == "gains" ? gain_ : torque_limit_) = values[0];
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      control::DrivenAxis& axis = scene_->control->axes[i] = axes_[i];
      axis.proportional *= gain_;
      axis.derivative *= gain_;
      axis.integral *= gain_;
      axis.torque_limit *= torque_limit_;
    }
    changed_ = true;
  } else if (name == "q") {
    q_.assign(values.begin(), values.end());
    moves_start_ = true;
  } else {
    set_of_object(name, values);
  }
}

void Variation::set_of_object(std::string_view name, std::span<const double> values) {
  std::string_view key;
  const std::size_t index = object_index(name, key);
  Object& object = objects_[index];
  if (key == "position") {
    object.position = {values[0], values[1], values[2]};
    moves_start_ = true;
    return;
  }
  if (key == "mass") {
    if (!(values[0] > 0)) refuse(name, fmt::format("{:g} kg", values[0]), "above 0 kg");
    model::Body& body = scene_->model.bodies[as_index(*scene_->model.objects[index].body)];
    body.mass = values[0];
    body.inertia = object.inertia * (values[0] / object.mass);
  } else {
    if (!(values[0] >= 0)) refuse(name, fmt::format("{:g}", values[0]), "0 or more");
    scene_->model.materials[material_of(index)].friction = values[0];
  }
  changed_ = true;
}

std::vector<double> Variation::get(std::string_view name) const {
  const auto numbers = [](const Vec3& v) { return std::vector<double>{v.x(), v.y(), v.z()}; };
  if (name == "gravity") return numbers(scene_->model.gravity);
  if (name == "gains") return {gain_};
  if (name == "torque_limits") return {torque_limit_};
  if (name == "q") return q_;
  std::string_view key;
  const std::size_t index = object_index(name, key);
  if (key == "position") return numbers(objects_[index].position);
  return {key == "mass" ? scene_->model.bodies[as_index(*scene_->model.objects[index].body)].mass
                        : scene_->model.materials[material_of(index)].friction};
}

void Variation::check(std::span<const Randomised> randomised, const model::State& start) {
  std::vector<Problem> problems;
  for (const Randomised& each : randomised) {
    const bool normal = each.distribution == Distribution::normal;
    const bool log = each.distribution == Distribution::log_uniform;
    const bool sound = std::isfinite(each.a) && std::isfinite(each.b) &&
                       (normal ? each.b >= 0 : each.a <= each.b && (!log || each.a > 0));
    try {
      if (!sound)
        refuse("randomise." + each.name, fmt::format("{:g}, {:g}", each.a, each.b),
               normal ? "a finite mean and a deviation of 0 or more"
               : log  ? "finite bounds above 0, the lower one first"
                      : "finite bounds, the lower one first");
      for (const double value : {each.a, normal ? each.a : each.b}) {
        set(each.name, std::vector<double>(size_of(each.name), value));
        model::State state = start;
        place(state);
      }
    } catch (const Error& error) {
      problems.insert(problems.end(), error.problems().begin(), error.problems().end());
    }
  }
  if (!problems.empty()) throw Error(std::move(problems));
}

void Variation::draw(std::span<const Randomised> randomised, std::uint64_t seed) {
  std::vector<double> values;
  for (const Randomised& each : randomised) {
    Draws draws(seed, 0, each.name);
    values.resize(size_of(each.name));
    for (double& value : values) switch (each.distribution) {
        case Distribution::uniform:
          value = draws.uniform(each.a, each.b);
          break;
        case Distribution::normal:
          value = each.a + each.b * draws.normal();
          break;
        case Distribution::log_uniform:
          value = draws.log_uniform(each.a, each.b);
          break;
      }
    set(each.name, values);
  }
}

void Variation::place(model::State& state) const {
  if (!moves_start_) return;
  for (std::size_t i = 0; i < objects_.size(); ++i)
    if (const std::optional<int> body = scene_->model.objects[i].body)
      state.bodies[as_index(*body)].p += objects_[i].position - objects_[i].own_position;
  std::vector<double> q = state.q;
  for (std::size_t i = 0; i < q.size(); ++i) q[i] += q_[i];
  simulation::place_start(*scene_, q, std::vector<double>(state.u), state);
}

}  // namespace handsim::environment
