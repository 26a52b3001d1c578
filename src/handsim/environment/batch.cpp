#include "handsim/environment/batch.h"

#include <algorithm>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "handsim/environment/environment.h"

namespace handsim::environment {

namespace {

constexpr std::size_t kGrain = 8;  ///< Environments that one task steps.
constexpr int kMostThreads = 1024;

/// Row `i` of an array of `rows` rows; empty where the array is.
template <class T>
std::span<T> row(std::span<T> all, std::size_t i, std::size_t rows) {
  const std::size_t width = all.size() / rows;
  return all.subspan(i * width, width);
}

int checked(int threads) {
  if (threads < 0 || threads > kMostThreads)
    throw input_error("threads", fmt::format("{}", threads),
                      fmt::format("0 to {}; 0: one per core", kMostThreads));
  return threads > 0 ? threads : tbb::task_arena::automatic;
}

}  // namespace

struct Batch::Impl {
  explicit Impl(int threads) : arena(checked(threads)) {}

  /// Calls f(i) for each environment, on all cores, also for those after one that throws. The first error in
  /// their order is thrown. A single group needs no other thread: entering the arena costs more than a step
  /// of some scenes.
  template <class F>
  void each(const F& f) {
    const std::size_t groups = (environments.size() + kGrain - 1) / kGrain;
    std::vector<std::optional<Error>> errors(groups);
    const auto each_of_group = [&](std::size_t group) {
      const std::size_t end = std::min((group + 1) * kGrain, environments.size());
      for (std::size_t i = group * kGrain; i < end; ++i) try {
          f(i);
        } catch (const Error& error) {
          if (!errors[group]) errors[group].emplace(error);
        }
    };
    if (groups == 1)
      each_of_group(0);
    else
      arena.execute([&] { tbb::parallel_for(std::size_t{0}, groups, each_of_group); });
    for (const std::optional<Error>& error : errors)
      if (error) throw Error(*error);
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
    if (names(first) != names((*this)[0]))
      throw input_error("scene", scene->spec.title,
                        "bodies, joints, axes, muscles, wrists, engine and step of the batch's");
    other = others.insert(others.end(), {scene, shared, std::move(first)});
  }
  impl_->environments.at(i) = Environment(other->shared, impl_->setup.environment, true, &other->first);
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
  for (const auto& [what, count] : {std::pair("torques", action.torques.size()),
                                    {"angles", action.angles.size()},
                                    {"wrists", action.wrists.size()},
                                    {"wrist_rates", action.wrist_rates.size()},
                                    {"excitations", action.excitations.size()},
                                    {"forces", action.forces.size()}})
    if (count % size() != 0)
      throw input_error(std::string("action.") + what, fmt::format("{} numbers", count),
                        fmt::format("a row for each of {} environments", size()));
  impl_->each([&](std::size_t i) {
    if (impl_->done[i] == 0) step_one(i, action, substeps);
  });
}

void Batch::step_one(std::size_t i, const BatchAction& action, int substeps) {
  Environment& environment = impl_->environments[i];
  try {
    environment.step(
        {.torques = row(action.torques, i, size()),
         .angles = row(action.angles, i, size()),
         .wrists = row(action.wrists, i, size()),
         .wrist_rates = row(action.wrist_rates, i, size()),
         .excitations = row(action.excitations, i, size()),
         .forces = action.forces.empty() ? std::span<const engine::BodyForce>() : action.forces[i]},
        substeps);
  } catch (const Error&) {
    if (!environment.failure()) throw;
    impl_->failed[i] = impl_->done[i] = 1;
  }
  impl_->observe(i);
  if (impl_->setup.done && impl_->done[i] == 0 && impl_->setup.done(environment)) impl_->done[i] = 1;
}

}  // namespace handsim::environment
