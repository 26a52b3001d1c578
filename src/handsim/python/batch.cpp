#include "handsim/environment/batch.h"

#include <algorithm>
#include <thread>

#include "handsim/environment/draws.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/forces.h"
#include "handsim/python/frame.h"
#include "handsim/python/signals.h"

namespace handsim::python {

namespace {

using environment::Batch;
using Drawn = std::tuple<std::string, std::string, double, double>;

/// Substeps between Python's signal handlers; fewer would take environments through the cache more often.
constexpr int kMostSubsteps = 500;

environment::BatchSetup setup_of(std::vector<std::string> observe, const std::vector<Drawn>& randomise,
                                 int threads, bool watch) {
  environment::BatchSetup out;
  out.environment.observe = std::move(observe);
  for (const auto& [name, kind, a, b] : randomise) {
    environment::Distribution of = environment::Distribution::uniform;
    if (kind == "normal")
      of = environment::Distribution::normal;
    else if (kind == "log_uniform")
      of = environment::Distribution::log_uniform;
    else if (kind != "uniform")
      throw input_error("randomise." + name, kind, "uniform, normal or log_uniform");
    out.environment.randomise.push_back({name, of, a, b});
  }
  if (watch) out.environment.watchers = simulation::standard_watchers;
  out.threads = threads;
  return out;
}

/// A batch whose arrays numpy views; its address does not change.
class BatchHandle {
 public:
  BatchHandle(const SceneHandle& of, std::size_t size, std::vector<std::string> observe,
              const std::vector<Drawn>& randomise, std::uint64_t seed, int threads, bool watch)
      : scene_(of.scene),
        batch_(without_gil([&] {
          environment::BatchSetup setup = setup_of(std::move(observe), randomise, threads, watch);
          setup.done = [this](const environment::Environment&) {
            poll();
            return false;
          };
          return Batch(*of.scene, size, std::move(setup));
        })),
        seed_(seed),
        episodes_(size) {}

  void step(const py::object& torques, const py::object& targets, const py::object& excitations,
            const py::object& wrists, const py::object& forces, int substeps) {
    const ActionArrays given(*scene_, batch_.size(), torques, targets, excitations, wrists, forces);
    const environment::BatchAction action{.torques = given.torques.span(),
                                          .angles = given.targets.span(),
                                          .wrists = given.wrists,
                                          .wrist_rates = {},
                                          .excitations = given.excitations.span(),
                                          .forces = given.forces};
    with_signals([&] { step_in_parts(action, substeps); });
  }

  /// `count` steps in one call, for benchmarks: the loop of a C++ program.
  void repeat(const py::object& torques, int substeps, int count) {
    const auto dofs = static_cast<py::ssize_t>(scene_->model.dof_count());
    const Numbers torque =
        Numbers::optional(torques, {static_cast<py::ssize_t>(batch_.size()), dofs}, "torques");
    environment::BatchAction action;
    action.torques = torque.span();
    with_signals([&] {
      for (int i = 0; i < count; ++i) batch_.step(action, substeps);
    });
  }

  /// @param seeds one for each environment, or None: those of this batch's own seed.
  void reset(const py::object& mask_of_rows, const py::object& seeds_of_rows, const Motion* motion) {
    const std::vector<unsigned char> mask = mask_of(mask_of_rows, batch_.size());
    const std::vector<std::uint64_t> seeds =
        seeds_of_rows.is_none() ? next_seeds(mask) : seeds_of(seeds_of_rows, batch_.size());
    calls_.one([&] {
      if (motion)
        batch_.reset(motion->motion, seeds, mask);
      else
        batch_.reset(seeds, mask);
    });
  }

  void replace(std::size_t i, const SceneHandle& scene) {
    calls_.one([&] { batch_.replace(i, scene.scene); });
  }

  /// Begins the seeds anew.
  void seed(std::uint64_t seed) {
    seed_ = seed;
    std::ranges::fill(episodes_, 0);
  }

  void set(const std::string& name, const py::object& values) {
    const std::size_t width = calls_.one([&] { return batch_[0].get(name).size(); });
    const Numbers numbers(values, {static_cast<py::ssize_t>(batch_.size()), static_cast<py::ssize_t>(width)},
                          name);
    calls_.one([&] {
      for (std::size_t i = 0; i < batch_.size(); ++i)
        batch_[i].set(name, numbers.span().subspan(i * width, width));
    });
  }

  py::array_t<double> get(const std::string& name) {
    std::vector<double> out;
    calls_.one([&] {
      for (std::size_t i = 0; i < batch_.size(); ++i) {
        const std::vector<double> row = batch_[i].get(name);
        out.insert(out.end(), row.begin(), row.end());
      }
    });
    return array_of(out, std::max<std::size_t>(1, out.size() / batch_.size()));
  }

  /// The result of a function of one environment, which no other thread changes meanwhile.
  template <class Find>
  auto read(std::size_t i, const Find& find) {
    if (i >= batch_.size())
      throw input_error("environment", std::to_string(i), "0 to " + std::to_string(batch_.size() - 1));
    return calls_.one([&] { return find(std::as_const(batch_[i])); });
  }

  const Batch& batch() const { return batch_; }

 private:
  /// A call in which Ctrl-C ends the steps.
  template <class Work>
  void with_signals(const Work& work) {
    calls_.one([&] {
      Signals signals;
      polled_ = &signals;
      caller_ = std::this_thread::get_id();
      struct End {
        BatchHandle& of;
        ~End() { of.polled_ = nullptr; }
      } const end{*this};
      work();
    });
  }

  /// The action holds for all substeps, so that parts give the same bits; wrists move over the whole call.
  void step_in_parts(const environment::BatchAction& action, int substeps) {
    if (!action.wrists.empty()) return batch_.step(action, substeps);
    int left = substeps;
    do {
      batch_.step(action, std::min(left, kMostSubsteps));
      left -= kMostSubsteps;
    } while (left > 0);
  }

  /// Called after each environment's step, by all threads. @throws Interrupted, which ends the batch's step
  void poll() {
    if (polled_ != nullptr && std::this_thread::get_id() == caller_) polled_->poll(0);
  }

  std::vector<std::uint64_t> next_seeds(const std::vector<unsigned char>& mask) {
    std::vector<std::uint64_t> out(batch_.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
      if (!mask.empty() && mask[i] == 0) continue;
      out[i] = environment::philox({i, episodes_[i]++, 0, 0}, {seed_, 0})[0];
    }
    return out;
  }

  ScenePtr scene_;
  Batch batch_;
  std::uint64_t seed_;
  std::vector<std::uint64_t> episodes_;  ///< resets of each environment
  Signals* polled_ = nullptr;            ///< during a step
  std::thread::id caller_;
  Calls calls_;
};

py::array observations(const py::object& self) {
  const Batch& batch = self.cast<const BatchHandle&>().batch();
  return view_of(self,
                 {static_cast<py::ssize_t>(batch.size()), static_cast<py::ssize_t>(batch.observation_size())},
                 batch.observations().data());
}

/// numpy's bool is a byte that is 0 or 1.
py::object flags(const py::object& self, std::span<const unsigned char> of) {
  return view_of(self, {static_cast<py::ssize_t>(of.size())}, of.data()).attr("view")("bool");
}

/// Name, first column and names of the columns of each part.
py::list parts(const BatchHandle& self) {
  py::list out;
  for (const environment::ObservedPart& part : self.batch()[0].observation().parts())
    out.append(py::make_tuple(part.name, part.first, part.columns));
  return out;
}

std::optional<std::string> failure(BatchHandle& self, std::size_t i) {
  return self.read(i, [](const environment::Environment& of) {
    return of.failure() ? std::optional<std::string>(of.failure()->what()) : std::nullopt;
  });
}

}  // namespace

void bind_batch(py::module_& module) {
  using Self = BatchHandle;
  module.def("batch", [](const SceneHandle& scene, std::size_t size, std::vector<std::string> observe,
                         const std::vector<Drawn>& randomise, std::uint64_t seed, int threads, bool watch) {
    return std::make_unique<Self>(scene, size, std::move(observe), randomise, seed, threads, watch);
  });
  bind_class<Self>(module, "Batch")
      .def("step", &Self::step)
      .def("repeat", &Self::repeat)
      .def("reset", &Self::reset)
      .def("replace", &Self::replace)
      .def("seed", &Self::seed)
      .def("set", &Self::set)
      .def("get", &Self::get)
      .def("parts", &parts)
      .def("failure", &failure)
      .def("motion",
           [](Self& self, std::size_t i) {
             return Motion{self.read(i, [](const auto& of) { return of.motion(); })};
           })
      .def("frame",
           [](Self& self, std::size_t i) {
             return Frame{self.read(
                 i, [](const auto& of) { return simulation::picture_state(of.simulation().engine()); })};
           })
      .def("observations", [](const py::object& self) { return observations(self); })
      .def("done",
           [](const py::object& self) { return flags(self, self.cast<const Self&>().batch().done()); })
      .def("failed",
           [](const py::object& self) { return flags(self, self.cast<const Self&>().batch().failed()); });
}

}  // namespace handsim::python
