#include "handsim/environment/batch.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "handsim/engine/articulated/lanes/lane_group.h"
#include "handsim/environment/environment.h"

namespace handsim::environment {

namespace articulated = engine::articulated;

namespace {

constexpr std::size_t kGrain = 8;  ///< Environments that one task steps.
/// Single steps are faster one by one than in lanes, because environments are loaded and stored in each call.
constexpr int kFewestSteps = 2;

constexpr int kMostThreads = 1024;

/// Row `i` of an array of `rows` rows; empty where the array is.
template <class T>
std::span<T> row(std::span<T> all, std::size_t i, std::size_t rows) {
  const std::size_t width = all.size() / rows;
  return all.subspan(i * width, width);
}

void require_rows(const char* what, std::size_t count, std::size_t rows) {
  if (count % rows != 0)
    throw input_error(std::string("action.") + what, fmt::format("{} numbers", count),
                      fmt::format("a row for each of {} environments", rows));
}

int checked(int threads) {
  if (threads < 0 || threads > kMostThreads)
    throw input_error("threads", fmt::format("{}", threads),
                      fmt::format("0 to {}; 0: one per core", kMostThreads));
  return threads > 0 ? threads : tbb::task_arena::automatic;
}

bool finite(std::span<const double> numbers) {
  return std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); });
}

bool excitable(const model::Model& model, const engine::Settings& settings, std::span<const double> by) {
  return by.empty() || (settings.effects.has(model::Effect::muscles) && by.size() == model.muscles.size() &&
                        std::ranges::all_of(by, [](double x) { return x >= 0 && x <= 1; }));
}

/// Constants of a controller with implicit gains.
void describe(const control::Controller& controller, articulated::LaneControlPlan& plan,
              const model::Model& model) {
  plan.drives.clear();
  plan.links.clear();
  for (const auto& axis : controller.constants())
    plan.drives.push_back({axis.dof, axis.gains.proportional, axis.gains.derivative, axis.gains.integral,
                           axis.gains.torque_limit, axis.zone, axis.smoothing, axis.tissue_stiffness,
                           axis.tissue_rest, 0});
  const control::GravityLoad* gravity = controller.gravity();
  if (!gravity) return;
  plan.gravity = gravity->gravity();
  for (const auto& link : gravity->links()) {
    const bool turns = link.universal || link.joint->kind == model::JointKind::hinge;
    plan.links.push_back({link.parent, link.child, link.dof, link.mass, model.bodies[link.child].mass,
                          link.adds_to_parent, turns, link.universal, link.joint->child_frame.p,
                          link.first_axis, link.universal ? link.second_axis : Vec3::Zero().eval()});
    if (!turns) plan.links.back().first_axis = Vec3::Zero();
  }
}

}  // namespace

/// Steps of environments of one scene in lanes (articulated/lane_group.h), to the bits of single steps.
class Lanes {
 public:
  /// @param like an environment of the scene, @param widest BatchSetup::lanes
  Lanes(const Environment& like, int widest)
      : group_(articulated::LaneGroup::make(like.simulation().engine(), widest)),
        torques_(at(width())),
        step_(like.scene().spec.solver.step) {
    const control::Controller* controller = like.simulation().controller();
    if (controller &&
        (controller->plan().form != control::Form::implicit_gain || controller->plan().feed_forward))
      group_.reset();
  }

  /// Environments that a call of `step` takes; 0 where the scene has no use for lanes.
  int width() const { return group_ ? group_->width() : 0; }
  /// True where an action's steps can begin in lanes.
  bool takes(Environment& environment, const Action& action) const {
    if (!group_ || environment.failure_ || !action.forces.empty() || !action.wrists.empty() ||
        !action.wrist_rates.empty())
      return false;
    const auto parts = environment.simulation_->parts();
    const auto dofs = at(environment.scene().model.dof_count());
    const std::size_t axes = parts && parts->controller ? parts->controller->axes().size() : 0;
    // What is wrong with an action is told by the environment alone; so is what touches something.
    return parts && (action.torques.empty() || action.torques.size() == dofs) && finite(action.torques) &&
           (action.angles.empty() || action.angles.size() == axes) && finite(action.angles) &&
           excitable(environment.scene().model, parts->engine.settings(), action.excitations) &&
           parts->engine.contacts().empty() &&
           group_->fits(parts->engine, parts->controller || !action.torques.empty());
  }

  struct Member {
    Environment* environment = nullptr;
    Action action;
    int made = 0;  ///< out: steps made; the environment has to make the others alone
  };
  /// @param members at most width(), all of which `takes` accepts
  void step(std::span<Member> members, int substeps) {
    unsigned active = 0;
    for (std::size_t lane = 0; lane < members.size(); ++lane) {
      load(static_cast<int>(lane), members[lane]);
      active |= 1U << lane;
    }
    group_->start();
    for (int i = 0; i < substeps && active != 0; ++i) {
      set_targets(members, active);
      const unsigned leave = group_->step();
      for (std::size_t lane = 0; lane < members.size(); ++lane)
        if ((leave >> lane) & 1U) store(static_cast<int>(lane), members[lane], i, true);
      active &= ~leave;
    }
    for (std::size_t lane = 0; lane < members.size(); ++lane)
      if ((active >> lane) & 1U) store(static_cast<int>(lane), members[lane], substeps, false);
  }

 private:
  void load(int lane, const Member& member) {
    Environment& environment = *member.environment;
    const simulation::Simulation::Parts parts = *environment.simulation_->parts();
    std::vector<double>& torques = torques_[at(lane)];
    torques.assign(parts.constant_torques.begin(), parts.constant_torques.end());
    if (!member.action.torques.empty()) {
      torques.resize(member.action.torques.size());
      for (std::size_t i = 0; i < torques.size(); ++i) torques[i] += member.action.torques[i];
    }
    control::Controller* controller = parts.controller;
    if (group_->key(lane) != environment.numbers_) {
      if (controller) describe(*controller, plan_, environment.scene().model);
      group_->set_constants(lane, parts.engine, controller ? &plan_ : nullptr, environment.numbers_);
    }
    group_->load(lane, parts.engine, torques, member.action.excitations);
    if (!controller) return;
    if (member.action.angles.empty())
      controller->release_targets();
    else
      controller->set_targets(member.action.angles);
    for (std::size_t i = 0; i < controller->axes().size(); ++i) {
      const control::AxisState& axis = controller->axis(i);
      group_->set_drive_state(lane, i,
                              {axis.angle, axis.rate, axis.target, axis.torque, axis.at_limit,
                               controller->integral(i), controller->filtered_rate(i)});
    }
  }

  /// Sets the targets of the next step. Environments share their trajectories and, mostly, the time.
  void set_targets(std::span<const Member> members, unsigned active) {
    const auto each = [&](const auto& f) {
      for (std::size_t lane = 0; lane < members.size(); ++lane)
        if ((active >> lane) & 1U)
          if (auto* controller = members[lane].environment->simulation_->parts()->controller)
            f(static_cast<int>(lane), *controller, group_->time(static_cast<int>(lane)) + step_);
    };
    std::optional<double> common;
    each([&](int /*lane*/, control::Controller& controller, double time) {
      if (common || controller.targets_given()) return;
      common = time;
      const std::span<const double> targets = controller.targets(time);
      for (std::size_t i = 0; i < controller.constants().size(); ++i)
        group_->set_targets(i, targets[controller.constants()[i].target]);
    });
    each([&](int lane, control::Controller& controller, double time) {
      if (!controller.targets_given() && time == common) return;
      const std::span<const double> targets = controller.targets(time);
      for (std::size_t i = 0; i < controller.constants().size(); ++i)
        group_->set_target(lane, i, targets[controller.constants()[i].target]);
    });
  }

  void store(int lane, Member& member, int made, bool leaves) {
    Environment& environment = *member.environment;
    const simulation::Simulation::Parts parts = *environment.simulation_->parts();
    member.made = made;
    if (parts.controller && made > 0)
      for (std::size_t i = 0; i < parts.controller->axes().size(); ++i) {
        const articulated::LaneDriveState state = group_->drive_state(lane, i);
        parts.controller->axis(i) = {state.angle, state.rate, state.target, state.torque, state.at_limit};
        parts.controller->integral(i) = state.integral;
        parts.controller->filtered_rate(i) = state.filtered_rate;
      }
    group_->store(lane, leaves);
    environment.simulation_->add_steps(made, member.action.excitations);
    environment.steps_ += made;
  }

  std::unique_ptr<articulated::LaneGroup> group_;
  articulated::LaneControlPlan plan_;
  std::vector<std::vector<double>> torques_;  ///< by lane
  double step_ = 0;                           ///< [s]
};

struct Batch::Impl {
  explicit Impl(int threads) : arena(checked(threads)) {}

  /// Calls f(first, last) for groups of environments, on all cores. The first error in their order is thrown.
  /// A single group needs no other thread: entering the arena costs more than a step of some scenes.
  template <class F>
  void each_group(const F& f) {
    const std::size_t groups = (environments.size() + kGrain - 1) / kGrain;
    if (groups == 1) return f(0, environments.size());
    std::vector<std::optional<Error>> errors(groups);
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, groups, [&](std::size_t group) {
        try {
          f(group * kGrain, std::min((group + 1) * kGrain, environments.size()));
        } catch (const Error& error) {
          errors[group].emplace(error);
        }
      });
    });
    for (const std::optional<Error>& error : errors)
      if (error) throw Error(*error);
  }
  /// As each_group(), but calls f(i) for each environment, also for those after one that throws.
  template <class F>
  void each(const F& f) {
    each_group([&](std::size_t first, std::size_t last) {
      std::optional<Error> found;
      for (std::size_t i = first; i < last; ++i) try {
          f(i);
        } catch (const Error& error) {
          if (!found) found.emplace(error);
        }
      if (found) throw Error(*found);
    });
  }
  void observe(std::size_t i) {
    const std::span<const double> now = environments[i].observe();
    std::ranges::copy(now, observations.begin() + static_cast<std::ptrdiff_t>(i * now.size()));
  }
  void begin(std::size_t i) {
    done[i] = failed[i] = 0;
    observe(i);
  }

  tbb::task_arena arena;
  BatchSetup setup;
  /// A scene that took the place of the first, and an environment of it.
  struct Other {
    std::shared_ptr<const scene::Scene> scene;
    std::shared_ptr<scene::Scene> shared;  ///< without what draws change in the first
    Environment first;
  };
  std::vector<Other> others;
  std::vector<Environment> environments;
  std::vector<double> observations;
  std::vector<unsigned char> done, failed;
  tbb::enumerable_thread_specific<std::optional<Lanes>> lanes;
};

Batch::Batch(const scene::Scene& scene, std::size_t size, BatchSetup setup)
    : impl_(std::make_unique<Impl>(setup.threads)) {
  if (size == 0) throw input_error("size", "0", "1 or more environments");
  impl_->setup = std::move(setup);
  impl_->environments.reserve(size);
  const std::shared_ptr<scene::Scene> shared = Environment::lean(scene);
  for (std::size_t i = 0; i < size; ++i)
    impl_->environments.push_back(Environment(shared, impl_->setup.environment, size > 1,
                                              i > 0 ? impl_->environments.data() : nullptr));
  impl_->observations.resize(size * observation_size());
  impl_->done.resize(size);
  impl_->failed.resize(size);
  impl_->each([&](std::size_t i) { impl_->begin(i); });
}

Batch::Batch(Batch&&) noexcept = default;
Batch& Batch::operator=(Batch&&) noexcept = default;
Batch::~Batch() = default;

std::size_t Batch::size() const { return impl_->environments.size(); }
std::size_t Batch::observation_size() const { return impl_->environments[0].observation().size(); }
Environment& Batch::operator[](std::size_t i) { return impl_->environments.at(i); }
const Environment& Batch::operator[](std::size_t i) const { return impl_->environments.at(i); }
std::span<const double> Batch::observations() const { return impl_->observations; }
std::span<const unsigned char> Batch::done() const { return impl_->done; }
std::span<const unsigned char> Batch::failed() const { return impl_->failed; }

void Batch::replace(std::size_t i, const std::shared_ptr<const scene::Scene>& scene) {
  const auto names = [](const Environment& of) {
    const model::Model& model = of.scene().model;
    std::vector<std::string> out;
    for (const model::Body& body : model.bodies) out.push_back(body.name);
    for (const model::Joint& joint : model.joints)
      out.push_back(fmt::format("{} {}", joint.name, static_cast<int>(joint.kind)));
    for (const model::Muscle& muscle : model.muscles) {
      out.push_back(muscle.name);
      for (const model::MomentArm& arm : muscle.path.arms) out.back() += fmt::format(" {}", arm.dof);
    }
    for (const ObservedPart& part : of.observation().parts())
      out.insert(out.end(), part.columns.begin(), part.columns.end());
    out.push_back(fmt::format("{} drives, {} axes, {} at {} s", model.drives.size(),
                              of.scene().control ? of.scene().control->axes.size() : 0,
                              of.simulation().engine().version(), of.scene().spec.solver.step));
    return out;
  };
  auto& others = impl_->others;
  auto other = std::ranges::find_if(others, [&](const auto& each) { return each.scene == scene; });
  if (other == others.end()) {
    const std::shared_ptr<scene::Scene> shared = Environment::lean(*scene);
    Environment first(shared, impl_->setup.environment, true, nullptr);
    first.renumber();
    if (names(first) != names((*this)[0]))
      throw input_error("scene", scene->spec.title,
                        "bodies, joints, axes, muscles, wrists, engine and step of the batch's");
    other = others.insert(others.end(), {scene, shared, std::move(first)});
  }
  const Environment& like = other->first;
  Environment made(other->shared, impl_->setup.environment, true, &like);
  if (made.shared_) made.numbers_ = like.numbers_;
  impl_->environments.at(i) = std::move(made);
  impl_->begin(i);
}

void Batch::reset(const simulation::MotionSnapshot* moment, std::span<const std::uint64_t> seeds,
                  std::span<const unsigned char> mask) {
  const auto require = [&](const char* what, std::size_t count) {
    if (count != 0 && count != size())
      throw input_error(what, fmt::format("{}", count),
                        fmt::format("one for each of {} environments", size()));
  };
  require("seeds", seeds.size());
  require("mask", mask.size());
  impl_->each([&](std::size_t i) {
    if (!mask.empty() && mask[i] == 0) return;
    Environment& environment = impl_->environments[i];
    if (!seeds.empty())
      environment.reset(seeds[i]);
    else if (moment == nullptr)
      environment.reset();
    if (moment != nullptr) environment.reset(*moment);
    impl_->begin(i);
  });
}

void Batch::step(const BatchAction& action, int substeps) {
  require_rows("torques", action.torques.size(), size());
  require_rows("angles", action.angles.size(), size());
  require_rows("wrists", action.wrists.size(), size());
  require_rows("wrist_rates", action.wrist_rates.size(), size());
  require_rows("excitations", action.excitations.size(), size());
  require_rows("forces", action.forces.size(), size());
  impl_->each_group([&](std::size_t first, std::size_t last) { step_group(first, last, action, substeps); });
}

void Batch::step_alone(std::size_t i, const Action& action, int substeps) {
  try {
    impl_->environments[i].step(action, substeps);
  } catch (const Error&) {
    if (!impl_->environments[i].failure()) throw;
    impl_->failed[i] = impl_->done[i] = 1;
  }
}

void Batch::step_group(std::size_t first, std::size_t last, const BatchAction& action, int substeps) {
  std::vector<Lanes::Member> members;
  std::vector<std::size_t> stepped;
  const auto of = [&](std::size_t i) {
    return Action{row(action.torques, i, size()),
                  row(action.angles, i, size()),
                  row(action.wrists, i, size()),
                  row(action.wrist_rates, i, size()),
                  row(action.excitations, i, size()),
                  action.forces.empty() ? std::span<const engine::BodyForce>() : action.forces[i]};
  };
  std::optional<Lanes>& lanes = impl_->lanes.local();
  if (impl_->setup.lanes > 0 && !lanes) lanes.emplace(impl_->environments[0], impl_->setup.lanes);
  for (std::size_t i = first; i < last; ++i) {
    if (impl_->done[i] != 0) continue;
    stepped.push_back(i);
    if (impl_->setup.lanes > 0 && substeps >= kFewestSteps && lanes->takes(impl_->environments[i], of(i)))
      members.push_back({&impl_->environments[i], of(i)});
  }
  for (std::size_t i = 0; i < members.size(); i += at(lanes->width())) {
    const std::size_t count = std::min(at(lanes->width()), members.size() - i);
    // Up to half of the lanes are faster one by one.
    if (2 * count > at(lanes->width())) lanes->step(std::span(members).subspan(i, count), substeps);
  }
  std::optional<Error> found;
  for (const std::size_t i : stepped) try {
      const auto member = std::ranges::find_if(
          members, [&](const Lanes::Member& each) { return each.environment == &impl_->environments[i]; });
      const int made = member == members.end() ? 0 : member->made;
      if (made < substeps || substeps < 1) step_alone(i, of(i), substeps - made);
      impl_->observe(i);
      if (impl_->setup.done && impl_->done[i] == 0 && impl_->setup.done(impl_->environments[i]))
        impl_->done[i] = 1;
    } catch (const Error& error) {
      if (!found) found.emplace(error);
    }
  if (found) throw Error(*found);
}

}  // namespace handsim::environment
