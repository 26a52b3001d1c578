#include "handsim/environment/environment.h"

#include <algorithm>
#include <condition_variable>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "handsim/engine/collision/taxels.h"
#include "handsim/model/kinematics.h"
#include "handsim/output/description/description.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/derivatives.h"
#include "handsim/python/forces.h"
#include "handsim/python/frame.h"
#include "handsim/python/signals.h"
#include "handsim/simulation/run/snapshot_file.h"

namespace handsim::python {

namespace {

/// A scene of the simulation's own.
std::shared_ptr<scene::Scene> with_forces(const SceneHandle& of, bool contact_forces) {
  auto out = std::make_shared<scene::Scene>(*of.scene);
  out->spec.solver.contact_forces = contact_forces;
  return out;
}

constexpr long kPolledEvery = 16;  ///< Steps between two chances for Python's signal handlers.
/// Parts of an observation, in the order of Muscles in _simulation.py.
const std::vector<std::string> kMuscleParts = {"excitation",  "activation",    "fibre_length",
                                               "fibre_speed", "tendon_length", "tendon_force"};

environment::Setup setup_of(const SceneHandle& of, bool watch) {
  environment::Setup out;
  out.observe = of.scene->model.muscles.empty() ? std::vector<std::string>() : kMuscleParts;
  if (watch) out.watchers = simulation::standard_watchers;
  return out;
}

/// An environment with buffers of its coordinates that numpy views; its address does not change.
class SimulationHandle {
 public:
  SimulationHandle(const SceneHandle& of, bool watch, bool contact_forces)
      : environment_(with_forces(of, contact_forces), setup_of(of, watch)) {
    const std::size_t dofs = simulation().state().q.size();
    for (std::vector<double>* each : {&q, &u, &tau}) each->resize(dofs);
    publish();
  }

  void step(const py::object& torques, const py::object& targets, const py::object& excitations,
            const py::object& wrists, const py::object& forces, int substeps) {
    const ActionArrays given(environment_.scene(), 0, torques, targets, excitations, wrists, forces);
    environment::Action action{.torques = given.torques.span(),
                               .angles = given.targets.span(),
                               .wrists = given.wrists,
                               .wrist_rates = {},
                               .excitations = given.excitations.span(),
                               .forces = {}};
    if (!given.forces.empty()) action.forces = given.forces[0];
    Signals signals;
    long steps = 0;
    guarded([&] {
      environment_.step(action, substeps, [&] {
        if (++steps % kPolledEvery == 0) signals.poll(0);
      });
    });
  }

  /// Steps in real time, as step() does, one step at a time: targets and wrists go evenly from their first to
  /// second rows in so many steps each (`length`), of which `done` are done; springs pull; each step waits
  /// for its time, unless `wake` ends the call.
  /// @param springs body, its point [m], its goal in the world [m], stiffness, damping, largest force
  /// @param start of the first step, by the monotonic clock [s]. @param period of the steps [s]; 0: no wait
  /// @return how long after its due start each step was complete [s], and the springs' last forces [N]
  py::tuple advance(const py::object& torques, const py::object& excitations, const py::object& forces,
                    const py::object& targets, const py::object& wrists, const py::array_t<double>& springs,
                    std::array<double, 2> done, std::array<double, 2> length, int substeps, double start,
                    double period) {
    const scene::Scene& scene = environment_.scene();
    const std::size_t axes = scene.control ? scene.control->axes.size() : 0,
                      drives = scene.model.drives.size();
    const auto size = [](std::size_t of) { return static_cast<py::ssize_t>(of); };
    const Numbers torque = Numbers::optional(torques, {size(q.size())}, "torques");
    const Numbers excited = Numbers::optional(excitations, {size(scene.model.muscles.size())}, "excitations");
    const Numbers target = Numbers::optional(targets, {2, size(axes)}, "targets");
    const auto ends = poses_of(Numbers::optional(wrists, {2, size(drives), 7}, "wrists"), "wrists");
    const Numbers spring(springs, {springs.ndim() > 0 ? springs.shape(0) : 0, 10}, "springs");
    std::vector<std::vector<engine::BodyForce>> given;
    read_forces(forces, scene.model, 0, given);
    given.resize(1);
    std::vector<engine::BodyForce> force;
    std::vector<double> angles(target.empty() ? 0 : axes), late, pulled;
    std::vector<Pose> places(ends.size() / 2);
    guarded([&] {
      for (int i = 0; i < substeps && !awaited(start + i * period, period); ++i) {
        const auto share = [&](std::size_t of) {
          return std::clamp((done[of] + i + 1) / length[of], 0.0, 1.0);
        };
        for (std::size_t k = 0; k < angles.size(); ++k)
          angles[k] = std::lerp(target.span()[k], target.span()[axes + k], share(0));
        for (std::size_t k = 0; k < places.size(); ++k)
          places[k] = {ends[k].p + share(1) * (ends[drives + k].p - ends[k].p),
                       ends[k].q.slerp(share(1), ends[drives + k].q)};
        force = given[0];
        pulled.clear();
        for (std::size_t k = 0; k < spring.span().size(); k += 10) pull(&spring.span()[k], force, pulled);
        environment_.step({torque.span(), angles, places, {}, excited.span(), force});
        late.push_back(seconds() - start - i * period);
      }
    });
    return py::make_tuple(array_of(late), array_of(pulled, 3));
  }

  /// Ends the waiting of `advance` in another thread, or of the next one.
  void wake() {
    const std::lock_guard lock(waking_);
    woken_ = true;
    bell_.notify_all();
  }

  /// Goes on from the state of another simulation of the same bodies: hands may have other sizes.
  void carry_over(SimulationHandle& from) {
    const model::State old = from.calls_.one([&] { return from.simulation().state(); });
    const model::Model &model = environment_.scene().model, &before = from.environment_.scene().model;
    model::State state = model::initial_state(model);
    if (old.bodies.size() != state.bodies.size() || old.q.size() != state.q.size() ||
        old.activation.size() != state.activation.size())
      throw input_error("scene", "one with other bodies, joints or muscles", "the same ones");
    std::vector<bool> hangs(state.bodies.size());
    std::vector<double> angles = old.q;
    for (const model::Joint& joint : model.joints) {
      hangs[as_index(joint.child)] = true;
      for (std::size_t a = 0; a < joint.axes.size(); ++a)
        if (const auto& stop = joint.axes[a].stop; stop)
          angles[as_index(joint.first_dof) + a] =
              std::clamp(angles[as_index(joint.first_dof) + a], stop->low, stop->high);
    }
    for (std::size_t i = 1; i < hangs.size(); ++i)
      if (!hangs[i]) state.bodies[i] = old.bodies[i];
    for (std::size_t i = 0; i < model.hands.size(); ++i)
      if (model::BodyState& palm = state.bodies[as_index(model.hands[i].palm)];
          !hangs[as_index(model.hands[i].palm)])
        palm.p = palm.pose() * (before.hands[i].wrist_frame * model.hands[i].wrist_frame.inverse()).p;
    state.time = old.time;
    state.activation = old.activation;
    simulation::place_start(environment_.scene(), angles, old.u, state);
    guarded([&] { environment_.resume(state); });
  }

  /// One step, with its derivatives.
  py::dict step_with_derivatives(const py::object& torques, const py::object& targets,
                                 const py::object& excitations, const py::object& wrists,
                                 const py::object& forces, const std::vector<std::string>& bodies,
                                 bool step_only) {
    const environment::Derivatives found = environment::step_with_derivatives(
        simulation(), [&] { step(torques, targets, excitations, wrists, forces, 1); },
        {bodies, !excitations.is_none(), step_only});
    return step_only ? py::dict() : arrays_of(found, simulation().model());
  }

  /// The buffers have the state afterwards, whatever happens.
  template <class Work>
  void guarded(const Work& work) {
    calls_.one([&] {
      struct Publish {
        SimulationHandle& of;
        ~Publish() { of.publish(); }
      } const publish{*this};
      work();
    });
  }
  /// The result of a function of the simulation, which no other thread changes meanwhile.
  template <class Find>
  auto read(const Find& find) {
    return calls_.one([&] { return find(simulation()); });
  }

  /// Values of kMuscleParts, shape [6, muscles].
  py::array_t<double> muscles() {
    const std::span<const double> all = calls_.one([&] { return environment_.observe(); });
    return array_of(all, environment_.scene().model.muscles.size());
  }

  py::tuple bodies() {
    std::vector<double> p, q4, v, w;
    for (const model::BodyState& body : read([](const auto& of) { return of.state().bodies; })) {
      append(p, body.p), append(q4, body.q), append(v, body.v), append(w, body.w);
    }
    return py::make_tuple(array_of(p, 3), array_of(q4, 4), array_of(v, 3), array_of(w, 3));
  }

  py::tuple contacts() {
    const auto contacts = read([](const auto& of) {
      return std::vector<engine::Contact>(of.engine().contacts().begin(), of.engine().contacts().end());
    });
    const std::vector<model::Shape>& shapes = simulation().model().shapes;
    std::vector<std::string> a, b;
    std::vector<double> position, normal, depth, force;
    for (const engine::Contact& contact : contacts) {
      a.push_back(shapes[as_index(contact.shape_a)].name);
      b.push_back(shapes[as_index(contact.shape_b)].name);
      append(position, contact.position), append(normal, contact.normal), append(force, contact.force);
      depth.push_back(contact.depth);
    }
    return py::make_tuple(a, b, array_of(position, 3), array_of(normal, 3), array_of(depth),
                          array_of(force, 3));
  }

  /// Pads: names, number of taxels; taxels: points in their bodies' frames, areas, forces.
  py::tuple taxels(double spacing) {
    if (!taxels_ || spacing != taxel_spacing_) taxels_.emplace(simulation().model(), spacing);
    taxel_spacing_ = spacing;
    const auto forces =
        read([&](const auto& of) { return taxels_->read(of.engine().contacts(), of.state()); });
    std::vector<std::string> names;
    std::vector<std::size_t> counts;
    for (const engine::Taxels::Pad& pad : taxels_->pads()) {
      names.push_back(pad.name);
      counts.push_back(pad.count);
    }
    std::vector<double> points;
    for (const Vec3& point : taxels_->points()) append(points, point);
    const std::vector<double> areas(taxels_->areas().begin(), taxels_->areas().end());
    return py::make_tuple(names, counts, array_of(points, 3), array_of(areas), array_of(forces));
  }

  environment::Environment& environment() { return environment_; }
  const simulation::Simulation& simulation() const { return environment_.simulation(); }

  std::vector<double> q, u, tau;

 private:
  std::optional<engine::Taxels> taxels_;
  double taxel_spacing_ = 0;

  void publish() {
    const model::State& state = simulation().state();
    for (const auto& [from, to] : {std::pair(&state.q, &q), {&state.u, &u}, {&state.tau, &tau}})
      std::ranges::copy(*from, to->begin());
  }

  static double seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }
  /// Waits for a time. @return true where `wake` was called
  bool awaited(double due, double period) {
    std::unique_lock lock(waking_);
    const auto woken = [&] { return woken_; };
    if (period > 0 && due > seconds())
      bell_.wait_for(lock, std::chrono::duration<double>(due - seconds()), woken);
    return std::exchange(woken_, false);
  }
  /// Adds the force of a spring, as a row of `advance`, on its body.
  void pull(const double* row, std::vector<engine::BodyForce>& forces, std::vector<double>& pulled) const {
    const auto index = static_cast<std::size_t>(row[0]);
    if (!(row[0] >= 1 && index < simulation().state().bodies.size()))
      throw input_error("springs", fmt::format("body {:g}", row[0]), "the index of one");
    const model::BodyState& body = simulation().state().bodies[index];
    const Vec3 arm = body.q * Vec3(row[1], row[2], row[3]), speed = body.v + body.w.cross(arm);
    Vec3 force = row[7] * (Vec3(row[4], row[5], row[6]) - body.p - arm) - row[8] * speed;
    force *= std::min(1.0, row[9] / std::max(force.norm(), 1e-12));
    engine::BodyForce& added = forces.emplace_back();
    added.body = static_cast<int>(index);
    added.force = force;
    added.moment = arm.cross(force);
    append(pulled, force);
  }

  environment::Environment environment_;
  Calls calls_;
  std::mutex waking_;
  std::condition_variable bell_;
  bool woken_ = false;
};

/// A view of a buffer that keeps the simulation alive.
py::array view(const py::object& self, const std::vector<double>& of) {
  return view_of(self, {static_cast<py::ssize_t>(of.size())}, of.data());
}

/// To the scene's start, or to coordinates, rates and places of objects.
void reset_to(SimulationHandle& self, const py::object& q, const py::object& u, const py::object& objects) {
  const auto dofs = static_cast<py::ssize_t>(self.q.size());
  const Numbers q_given = Numbers::optional(q, {dofs}, "q"), u_given = Numbers::optional(u, {dofs}, "u");
  py::ssize_t movable = 0;
  for (const auto& object : self.simulation().scene().plans.objects) movable += !object.is_static;
  const std::vector<Pose> poses = poses_of(Numbers::optional(objects, {movable, 7}, "objects"), "objects");
  self.guarded([&] {
    if (q.is_none() && u.is_none() && objects.is_none()) return self.environment().reset();
    self.environment().reset(environment::Start{q_given.span(), u_given.span(), poses});
  });
}

void bind_states(py::module_& module) {
  using simulation::RunSnapshot;
  module.def("snapshot",
             [](const py::bytes& text) { return simulation::parse_snapshot(std::string(text), "snapshot"); });
  bind_class<RunSnapshot>(module, "Snapshot")
      .def_property_readonly("time", [](const RunSnapshot& of) { return of.time; })
      .def("__reduce__", [](const RunSnapshot& of) {
        return py::make_tuple(py::module_::import("handsim._simulation").attr("snapshot_of"),
                              py::make_tuple(py::bytes(simulation::snapshot_text(of))));
      });
  bind_class<Motion>(module, "Motion").def_property_readonly("time", [](const Motion& of) {
    return of.motion.time();
  });
}

}  // namespace

void bind_simulation(py::module_& module) {
  using Self = SimulationHandle;
  bind_states(module);
  // What a function finds in the simulation.
  const auto found = [](auto find) { return [find](Self& self) { return self.read(find); }; };
  module.def("simulation", [](const SceneHandle& scene, bool watch, bool contact_forces) {
    return std::make_unique<Self>(scene, watch, contact_forces);
  });
  bind_class<Self>(module, "Simulation")
      .def("step", &Self::step)
      .def("advance", &Self::advance)
      .def("wake", &Self::wake)
      .def("carry_over", &Self::carry_over)
      .def("wrists",
           [](Self& self) {
             std::vector<double> out;
             const auto bodies = self.read([](const auto& of) { return of.state().bodies; });
             for (const model::Drive& drive : self.simulation().model().drives)
               append(out, bodies[as_index(drive.body)].pose() * drive.frame);
             return array_of(out, 7);
           })
      .def("targets",
           [](Self& self) {
             return array_of(self.read([](const auto& of) {
               std::vector<double> out;
               if (const auto* controller = of.controller())
                 for (const control::AxisState& axis : controller->axes()) out.push_back(axis.target);
               return out;
             }));
           })
      .def("step_with_derivatives", &Self::step_with_derivatives)
      .def("muscles", &Self::muscles)
      .def("set",
           [](Self& self, const std::string& name, const py::object& values) {
             const auto size = self.read([&](const auto&) { return self.environment().get(name).size(); });
             const Numbers numbers(values, {static_cast<py::ssize_t>(size)}, name);
             self.guarded([&] { self.environment().set(name, numbers.span()); });
           })
      .def("get",
           [](Self& self, const std::string& name) {
             return array_of(self.read([&](const auto&) { return self.environment().get(name); }));
           })
      .def("bodies", &Self::bodies)
      .def("contacts", &Self::contacts)
      .def("taxels", &Self::taxels)
      .def("reset", &reset_to)
      .def("reset_beside",
           [](Self& self, Self& other, const py::object& change) {
             const model::State state = other.read([](const auto& of) { return of.state(); });
             const model::Model& model = self.environment().scene().model;
             const auto n = static_cast<py::ssize_t>(state.q.size() + 6 * model::free_bodies(model).size());
             const Numbers by = Numbers::optional(change, {2 * n}, "change");
             self.guarded([&] { self.environment().reset_beside(moved(model, state, by.span())); });
           })
      .def("snapshot", found([](const auto& of) { return of.snapshot(); }))
      .def("restore",
           [](Self& self, const simulation::RunSnapshot& snapshot) {
             self.guarded([&] { self.environment().restore(snapshot); });
           })
      .def("motion", found([](const auto& of) { return Motion{of.motion()}; }))
      .def("reset_to_motion",
           [](Self& self, const Motion& motion) {
             self.guarded([&] { self.environment().reset(motion.motion); });
           })
      .def("frame", found([](const auto& of) { return Frame{simulation::picture_state(of.engine())}; }))
      .def("description", found([](const auto& of) {
             const scene::Scene& scene = of.scene();
             const output::Moment now = output::moment_after(of.state(), of.controller());
             return output::description(scene.model, scene.spec.solver,
                                        scene.control ? &*scene.control : nullptr, &now);
           }))
      .def("verdicts",
           [](Self& self) { return verdict_list(self.read([](const auto& of) { return of.verdicts(); })); })
      .def_property_readonly("time", found([](const auto& of) { return of.state().time; }))
      .def_property_readonly("steps", found([](const auto& of) { return of.steps(); }))
      .def_property_readonly("q", [](const py::object& self) { return view(self, self.cast<Self&>().q); })
      .def_property_readonly("u", [](const py::object& self) { return view(self, self.cast<Self&>().u); })
      .def_property_readonly("tau",
                             [](const py::object& self) { return view(self, self.cast<Self&>().tau); });
}

}  // namespace handsim::python
