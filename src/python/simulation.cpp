#include "handsim/environment/environment.h"

#include "handsim/core/index.h"
#include "handsim/model/kinematics.h"
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
    const scene::Scene& scene = environment_.scene();
    const auto optional = [](const py::object& given, std::size_t size, const char* name) {
      return Numbers::optional(given, {static_cast<py::ssize_t>(size)}, name);
    };
    const Numbers torque = optional(torques, q.size(), "torques");
    const Numbers target = optional(targets, scene.control ? scene.control->axes.size() : 0, "targets");
    const Numbers excitation = optional(excitations, scene.model.muscles.size(), "excitations");
    const auto drives = static_cast<py::ssize_t>(scene.model.drives.size());
    const std::vector<Pose> poses = poses_of(Numbers::optional(wrists, {drives, 7}, "wrists"));
    std::vector<std::vector<engine::BodyForce>> force;
    read_forces(forces, scene.model, 0, force);
    environment::Action action{.torques = torque.span(),
                               .angles = target.span(),
                               .wrists = poses,
                               .wrist_rates = {},
                               .excitations = excitation.span(),
                               .forces = {}};
    if (!force.empty()) action.forces = force[0];
    Signals signals;
    long steps = 0;
    guarded([&] {
      environment_.step(action, substeps, [&] {
        if (++steps % kPolledEvery == 0) signals.poll(0);
      });
    });
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
  /// What a function finds in the simulation.
  template <class Find>
  auto read(const Find& find) {
    return calls_.one([&] { return find(simulation()); });
  }

  /// Of kMuscleParts [6, muscles].
  py::array_t<double> muscles() {
    const std::span<const double> all = calls_.one([&] { return environment_.observe(); });
    return array_of(all, environment_.scene().model.muscles.size());
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
    const std::vector<model::Shape>& shapes = simulation().model().shapes;
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

  environment::Environment& environment() { return environment_; }
  const simulation::Simulation& simulation() const { return environment_.simulation(); }

  std::vector<double> q, u, tau;

 private:
  void publish() {
    const model::State& state = simulation().state();
    std::copy(state.q.begin(), state.q.end(), q.begin());
    std::copy(state.u.begin(), state.u.end(), u.begin());
    std::copy(state.tau.begin(), state.tau.end(), tau.begin());
  }

  environment::Environment environment_;
  Calls calls_;
};

/// A view of a buffer that keeps the simulation alive.
py::array view(const py::object& self, const std::vector<double>& of) {
  py::array_t<double> out(static_cast<py::ssize_t>(of.size()), of.data(), self);
  out.attr("flags").attr("writeable") = false;
  return out;
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
      .def("step", &Self::step, py::arg("torques"), py::arg("targets"), py::arg("excitations"),
           py::arg("wrists"), py::arg("forces"), py::arg("substeps"))
      .def("step_with_derivatives", &Self::step_with_derivatives, py::arg("torques"), py::arg("targets"),
           py::arg("excitations"), py::arg("wrists"), py::arg("forces"), py::arg("bodies"),
           py::arg("step_only"))
      .def("muscles", &Self::muscles)
      .def(
          "set",
          [](Self& self, const std::string& name, const py::object& values) {
            const auto size = self.read([&](const auto&) { return self.environment().get(name).size(); });
            const Numbers numbers(values, {static_cast<py::ssize_t>(size)}, name);
            self.guarded([&] { self.environment().set(name, numbers.span()); });
          },
          py::arg("name"), py::arg("values"))
      .def(
          "get",
          [](Self& self, const std::string& name) {
            return array_of(self.read([&](const auto&) { return self.environment().get(name); }));
          },
          py::arg("name"))
      .def("bodies", &Self::bodies)
      .def("contacts", &Self::contacts)
      .def("reset", &reset_to, py::arg("q"), py::arg("u"), py::arg("objects"))
      .def("reset_beside",
           [](Self& self, Self& other) {
             const model::State state = other.read([](const auto& of) { return of.state(); });
             self.guarded([&] { self.environment().reset_beside(state); });
           })
      .def("snapshot", [](Self& self) { return self.read([](const auto& of) { return of.snapshot(); }); })
      .def("restore",
           [](Self& self, const simulation::RunSnapshot& snapshot) {
             self.guarded([&] { self.environment().restore(snapshot); });
           })
      .def("motion", [](Self& self) { return Motion{self.read([](const auto& of) { return of.motion(); })}; })
      .def("reset_to_motion",
           [](Self& self, const Motion& motion) {
             self.guarded([&] { self.environment().reset(motion.motion); });
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
