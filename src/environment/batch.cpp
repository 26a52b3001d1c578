#include "handsim/environment/batch.h"

#include <algorithm>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace handsim::environment {

namespace {

/// Environments that one task steps.
constexpr std::size_t kGrain = 8;

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

}  // namespace

struct Batch::Impl {
  explicit Impl(int threads) : arena(threads > 0 ? threads : tbb::task_arena::automatic) {}

  /// Calls f(i) for all environments, on all cores. The first error in their order is thrown.
  template <class F>
  void each(const F& f) {
    std::vector<std::optional<Error>> errors(environments.size());
    const auto task = [&](const tbb::blocked_range<std::size_t>& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) try {
          f(i);
        } catch (const Error& error) {
          errors[i].emplace(error);
        }
    };
    arena.execute([&] {
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, environments.size(), kGrain), task,
                        tbb::simple_partitioner());
    });
    for (const std::optional<Error>& error : errors)
      if (error) throw Error(*error);
  }
  void observe(std::size_t i) {
    const std::span<const double> now = environments[i].observe();
    std::copy(now.begin(), now.end(), observations.begin() + static_cast<std::ptrdiff_t>(i * now.size()));
  }
  void begin(std::size_t i) {
    done[i] = failed[i] = 0;
    observe(i);
  }

  void reset(std::span<const std::uint64_t> seeds, std::span<const unsigned char> mask,
             const Moment* moment) {
    const auto require = [&](const char* what, std::size_t count) {
      if (count != 0 && count != environments.size())
        throw input_error(what, fmt::format("{}", count),
                          fmt::format("one for each of {} environments", environments.size()));
    };
    require("seeds", seeds.size());
    require("mask", mask.size());
    each([&](std::size_t i) {
      if (!mask.empty() && mask[i] == 0) return;
      Environment& environment = environments[i];
      if (!seeds.empty())
        environment.reset(seeds[i]);
      else if (moment == nullptr)
        environment.reset();
      if (moment != nullptr) environment.reset(*moment);
      begin(i);
    });
  }

  tbb::task_arena arena;
  BatchSetup setup;
  std::vector<Environment> environments;
  std::vector<double> observations;
  std::vector<unsigned char> done, failed;
};

Batch::Batch(const scene::Scene& scene, std::size_t size, BatchSetup setup)
    : impl_(std::make_unique<Impl>(setup.threads)) {
  if (size == 0) throw input_error("size", "0", "1 or more environments");
  impl_->setup = std::move(setup);
  impl_->environments.reserve(size);
  for (std::size_t i = 0; i < size; ++i) impl_->environments.emplace_back(scene, impl_->setup.environment);
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

void Batch::reset(std::span<const unsigned char> mask) { reset({}, mask); }

void Batch::reset(std::span<const std::uint64_t> seeds, std::span<const unsigned char> mask) {
  impl_->reset(seeds, mask, nullptr);
}

void Batch::reset(const Moment& moment, std::span<const std::uint64_t> seeds,
                  std::span<const unsigned char> mask) {
  impl_->reset(seeds, mask, &moment);
}

void Batch::step(const BatchAction& action, int substeps) {
  require_rows("torques", action.torques.size(), size());
  require_rows("angles", action.angles.size(), size());
  require_rows("wrists", action.wrists.size(), size());
  require_rows("wrist_rates", action.wrist_rates.size(), size());
  require_rows("forces", action.forces.size(), size());
  impl_->each([&](std::size_t i) {
    if (impl_->done[i] != 0) return;
    Environment& environment = impl_->environments[i];
    try {
      environment.step({row(action.torques, i, size()), row(action.angles, i, size()),
                        row(action.wrists, i, size()), row(action.wrist_rates, i, size()),
                        action.forces.empty() ? std::span<const engine::BodyForce>() : action.forces[i]},
                       substeps);
    } catch (const Error&) {
      if (!environment.failure()) throw;
      impl_->failed[i] = impl_->done[i] = 1;
    }
    impl_->observe(i);
    if (impl_->setup.done && impl_->done[i] == 0 && impl_->setup.done(environment)) impl_->done[i] = 1;
  });
}

}  // namespace handsim::environment
