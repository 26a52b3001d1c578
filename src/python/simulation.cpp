#include "handsim/simulation/simulation.h"

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
    const auto axes = simulation_.scene().control ? simulation_.scene().control->axes.size() : 0;
    const auto drives = simulation_.model().drives.size();
    if (substeps < 1) throw input_error("substeps", std::to_string(substeps), "1 or more");
    const Numbers torque = Numbers::optional(torques, {dofs}, "torques");
    const Numbers target = Numbers::optional(targets, {static_cast<py::ssize_t>(axes)}, "targets");
    const std::vector<Pose> poses =
        poses_of(Numbers::optional(wrists, {static_cast<py::ssize_t>(drives), 7}, "wrists"));
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
  /// What a function finds in the simulation.
  template <class Find>
  auto read(const Find& find) {
    return calls_.one([&] { return find(std::as_const(simulation_)); });
  }

  py::tuple bodies() {
    const auto bodies = read([](const auto& of) { return of.state().bodies; });
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

  py::tuple contacts() {
    const auto contacts = read([](const auto& of) {
      return std::vector<engine::Contact>(of.engine().contacts().begin(), of.engine().contacts().end());
    });
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
  Calls calls_;
};

/// A view of a buffer that keeps the simulation alive.
py::array view(const py::object& self, const std::vector<double>& of) {
  py::array_t<double> out(static_cast<py::ssize_t>(of.size()), of.data(), self);
  out.attr("flags").attr("writeable") = false;
  return out;
}

/// To the scene's start, or to coordinates and rates.
void reset_to(SimulationHandle& self, const py::object& q_of, const py::object& u_of) {
  const auto dofs = static_cast<py::ssize_t>(self.q.size());
  const Numbers q_given = Numbers::optional(q_of, {dofs}, "q"),
                u_given = Numbers::optional(u_of, {dofs}, "u");
  self.guarded([&] {
    simulation::Simulation& simulation = self.simulation();
    if (q_of.is_none() && u_of.is_none()) return simulation.reset();
    model::State state = model::initial_state(simulation.model());
    const std::vector<double> q0 = state.q, u0(self.q.size());
    simulation::place_start(simulation.scene(),
                            q_given.empty() ? std::span<const double>(q0) : q_given.span(),
                            u_given.empty() ? std::span<const double>(u0) : u_given.span(), state);
    simulation.reset(state);
  });
}

void bind_states(py::module_& module) {
  using simulation::RunSnapshot;
  module.def(
      "snapshot",
      [](const py::bytes& text) { return simulation::parse_snapshot(std::string(text), "snapshot"); },
      py::arg("text"));
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
  module.def(
      "simulation",
      [](const SceneHandle& scene, bool watch, bool contact_forces) {
        return std::make_unique<Self>(scene, watch, contact_forces);
      },
      py::arg("scene"), py::arg("watch"), py::arg("contact_forces"));
  auto bound = bind_class<Self>(module, "Simulation");
  bound
      .def("step", &Self::step, py::arg("torques"), py::arg("targets"), py::arg("wrists"), py::arg("forces"),
           py::arg("substeps"))
      .def("bodies", &Self::bodies)
      .def("contacts", &Self::contacts)
      .def("reset", &reset_to, py::arg("q"), py::arg("u"))
      .def("snapshot", [](Self& self) { return self.read([](const auto& of) { return of.snapshot(); }); })
      .def("restore",
           [](Self& self, const simulation::RunSnapshot& snapshot) {
             self.guarded([&] { self.simulation().restore(snapshot); });
           })
      .def("motion", [](Self& self) { return Motion{self.read([](const auto& of) { return of.motion(); })}; })
      .def("reset_to_motion",
           [](Self& self, const Motion& motion) {
             self.guarded([&] { self.simulation().reset(motion.motion); });
           })
      .def("frame",
           [](Self& self) {
             return Frame{self.read([](const auto& of) { return simulation::moment_of(of.engine()); })};
           })
      .def("verdicts",
           [](Self& self) { return verdict_list(self.read([](const auto& of) { return of.verdicts(); })); });
  bound
      .def_property_readonly(
          "time", [](Self& self) { return self.read([](const auto& of) { return of.state().time; }); })
      .def_property_readonly("steps",
                             [](Self& self) { return self.read([](const auto& of) { return of.steps(); }); })
      .def_property_readonly("q", [](const py::object& self) { return view(self, self.cast<Self&>().q); })
      .def_property_readonly("u", [](const py::object& self) { return view(self, self.cast<Self&>().u); })
      .def_property_readonly("tau",
                             [](const py::object& self) { return view(self, self.cast<Self&>().tau); });
}

}  // namespace handsim::python
