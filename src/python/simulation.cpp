#include "handsim/simulation/simulation.h"

#include <mutex>

#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"
#include "handsim/python/arrays.h"
#include "handsim/python/bindings.h"
#include "handsim/python/forces.h"
#include "handsim/python/frame.h"
#include "handsim/python/signals.h"
#include "handsim/simulation/run/snapshot_file.h"

namespace handsim::python {

namespace {

ScenePtr with_forces(const SceneHandle& of, bool contact_forces) {
  if (of.scene->spec.solver.contact_forces == contact_forces) return of.scene;
  auto out = std::make_shared<scene::Scene>(*of.scene);
  out->spec.solver.contact_forces = contact_forces;
  return out;
}

/// A simulation with buffers of its coordinates that numpy views; its address does not change.
class SimulationHandle {
 public:
  SimulationHandle(const SceneHandle& of, bool watch, bool contact_forces)
      : simulation_(
            with_forces(of, contact_forces),
            watch ? simulation::MakeWatchers(simulation::standard_watchers) : simulation::no_watchers) {
    const std::size_t dofs = simulation_.state().q.size();
    for (std::vector<double>* each : {&q, &u, &tau}) each->resize(dofs);
    publish();
  }

  void step(const py::object& torques, const py::object& targets, const py::object& wrists,
            const py::object& forces, long substeps) {
    const auto dofs = static_cast<py::ssize_t>(q.size());
    const auto axes = simulation_.controller() ? simulation_.controller()->axes().size() : 0;
    const auto drives = simulation_.model().drives.size();
    if (substeps < 1) throw input_error("substeps", std::to_string(substeps), "1 or more");
    const Numbers torque(torques, {dofs}, "torques");
    const Numbers target(targets, {static_cast<py::ssize_t>(axes)}, "targets");
    const std::vector<Pose> poses =
        poses_of(Numbers(wrists, {static_cast<py::ssize_t>(drives), 7}, "wrists"));
    std::vector<std::vector<engine::BodyForce>> force;
    read_forces(forces, simulation_.model(), 0, force);
    Signals signals;
    guarded([&] {
      const engine::StepInput input{.torques = torque.span(),
                                    .forces = force.empty() ? std::span<const engine::BodyForce>() : force[0],
                                    .drive_targets = {}};
      run(input, target.span(), poses, substeps, signals);
    });
  }

  void run(engine::StepInput input, std::span<const double> targets, const std::vector<Pose>& wrists,
           long substeps, Signals& signals) {
    std::vector<Pose> from, to(wrists.size());
    for (std::size_t i = 0; i < wrists.size(); ++i) {
      const model::Drive& drive = simulation_.model().drives[i];
      from.push_back(simulation_.state().bodies[at(drive.body)].pose() * drive.frame);
    }
    for (long k = 1; k <= substeps; ++k) {
      for (std::size_t i = 0; i < wrists.size(); ++i)
        to[i] = between(from[i], wrists[i], static_cast<double>(k) / static_cast<double>(substeps));
      input.drive_targets = to;
      simulation_.step(input, targets);
      if (k % 16 == 0) signals.poll(0);
    }
  }

  /// Without the GIL, one thread at a time; the buffers have the state afterwards, whatever happens.
  template <class Work>
  void guarded(Work&& work) {
    without_gil([&] {
      const std::lock_guard lock(mutex_);
      struct Publish {
        SimulationHandle& of;
        ~Publish() { of.publish(); }
      } const publish{*this};
      work();
      return 0;
    });
  }

  py::tuple bodies() const {
    const auto& bodies = simulation_.state().bodies;
    const auto rows = static_cast<py::ssize_t>(bodies.size());
    py::array_t<double> p({rows, py::ssize_t{3}}), q4({rows, py::ssize_t{4}}), v({rows, py::ssize_t{3}}),
        w({rows, py::ssize_t{3}});
    for (py::ssize_t i = 0; i < rows; ++i) {
      const model::BodyState& body = bodies[static_cast<std::size_t>(i)];
      const Quat& turn = body.q;
      const std::array<double, 4> wxyz = {turn.w(), turn.x(), turn.y(), turn.z()};
      for (py::ssize_t k = 0; k < 4; ++k) q4.mutable_at(i, k) = wxyz[static_cast<std::size_t>(k)];
      for (py::ssize_t k = 0; k < 3; ++k) {
        p.mutable_at(i, k) = body.p[k];
        v.mutable_at(i, k) = body.v[k];
        w.mutable_at(i, k) = body.w[k];
      }
    }
    return py::make_tuple(p, q4, v, w);
  }

  py::tuple contacts() const {
    const auto contacts = simulation_.engine().contacts();
    const std::vector<model::Shape>& shapes = simulation_.model().shapes;
    std::vector<std::string> a, b;
    std::vector<double> position, normal, depth, force;
    const auto add = [](std::vector<double>& out, const Vec3& v) {
      out.insert(out.end(), {v.x(), v.y(), v.z()});
    };
    for (const engine::Contact& contact : contacts) {
      a.push_back(shapes[at(contact.shape_a)].name);
      b.push_back(shapes[at(contact.shape_b)].name);
      add(position, contact.position);
      add(normal, contact.normal);
      add(force, contact.force);
      depth.push_back(contact.depth);
    }
    return py::make_tuple(a, b, array_of(position, 3), array_of(normal, 3), array_of(depth),
                          array_of(force, 3));
  }

  simulation::Simulation& simulation() { return simulation_; }

  std::vector<double> q, u, tau;

 private:
  void publish() {
    const model::State& state = simulation_.state();
    std::copy(state.q.begin(), state.q.end(), q.begin());
    std::copy(state.u.begin(), state.u.end(), u.begin());
    std::copy(state.tau.begin(), state.tau.end(), tau.begin());
  }

  simulation::Simulation simulation_;
  std::mutex mutex_;
};

/// A view of a buffer that keeps the simulation alive.
py::array view(const py::object& self, const std::vector<double>& of) {
  py::array_t<double> out(static_cast<py::ssize_t>(of.size()), of.data(), self);
  out.attr("flags").attr("writeable") = false;
  return out;
}

void reset_to(SimulationHandle& self, const py::object& q_of, const py::object& u_of) {
  const model::Model& model = self.simulation().model();
  const auto dofs = static_cast<py::ssize_t>(self.q.size());
  const Numbers q_given(q_of, {dofs}, "q"), u_given(u_of, {dofs}, "u");
  self.guarded([&] {
    model::State state = model::initial_state(model);
    const std::vector<double> q0 = state.q, u0(self.q.size());
    model::place_joints(model, q_given.empty() ? std::span<const double>(q0) : q_given.span(),
                        u_given.empty() ? std::span<const double>(u0) : u_given.span(), state);
    self.simulation().reset(state);
  });
}

simulation::RunSnapshot take_snapshot(SimulationHandle& self) {
  simulation::RunSnapshot out;
  self.guarded([&] { out = self.simulation().snapshot(); });
  return out;
}

void bind_states(py::module_& module) {
  using simulation::RunSnapshot;
  py::class_<RunSnapshot>(module, "Snapshot")
      .def_property_readonly("time", [](const RunSnapshot& of) { return of.time; })
      .def(py::pickle(
          [](const RunSnapshot& of) { return py::bytes(simulation::snapshot_text(of)); },
          [](const py::bytes& text) { return simulation::parse_snapshot(std::string(text), "snapshot"); }));
  py::class_<Motion>(module, "Motion").def_property_readonly("time", [](const Motion& of) {
    return of.motion.time();
  });
}

}  // namespace

void bind_simulation(py::module_& module) {
  using Self = SimulationHandle;
  bind_states(module);
  py::class_<Self> bound(module, "Simulation");
  bound
      .def(py::init<const SceneHandle&, bool, bool>(), py::arg("scene"), py::arg("watch"),
           py::arg("contact_forces"))
      .def("step", &Self::step, py::arg("torques"), py::arg("targets"), py::arg("wrists"), py::arg("forces"),
           py::arg("substeps"))
      .def("bodies", &Self::bodies)
      .def("contacts", &Self::contacts)
      .def("reset", &reset_to, py::arg("q"), py::arg("u"))
      .def("snapshot", &take_snapshot)
      .def("restore",
           [](Self& self, const simulation::RunSnapshot& snapshot) {
             self.guarded([&] { self.simulation().restore(snapshot); });
           })
      .def("motion", [](Self& self) { return Motion{self.simulation().motion()}; })
      .def("reset_to_motion",
           [](Self& self, const Motion& motion) {
             self.guarded([&] { self.simulation().reset(motion.motion); });
           })
      .def("frame", [](Self& self) { return Frame{simulation::moment_of(self.simulation().engine())}; })
      .def("verdicts", [](Self& self) {
        py::list out;
        for (const simulation::Verdict& v : self.simulation().verdicts())
          out.append(py::make_tuple(v.name, v.unit, v.measured, v.limit, v.least, v.held(), v.time, v.where));
        return out;
      });
  bound.def_property_readonly("time", [](Self& self) { return self.simulation().state().time; })
      .def_property_readonly("steps", [](Self& self) { return self.simulation().steps(); })
      .def_property_readonly("q", [](const py::object& self) { return view(self, self.cast<Self&>().q); })
      .def_property_readonly("u", [](const py::object& self) { return view(self, self.cast<Self&>().u); })
      .def_property_readonly("tau",
                             [](const py::object& self) { return view(self, self.cast<Self&>().tau); });
}

}  // namespace handsim::python
