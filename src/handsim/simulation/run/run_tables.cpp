#include "handsim/simulation/run/run_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/units.h"
#include "handsim/model/energy.h"
#include "handsim/model/markers.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/output/table/table_files.h"
#include "handsim/simulation/run/output_size.h"

namespace handsim::simulation {

namespace {

using Row = std::vector<double>;

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

void append(Row& row, const Vec3& v) { row.insert(row.end(), {v.x(), v.y(), v.z()}); }

/// Columns `NAME.part[unit]` for each thing and part.
template <class Things>
std::string columns_of(const Things& things, std::initializer_list<const char*> parts) {
  std::string out;
  for (const auto& thing : things)
    for (const char* part : parts) out += fmt::format(",{}.{}", thing.name, part);
  return out;
}

/// OpenSim tables cannot mix angles and lengths in degrees: models with sliders have none.
bool all_angles(const model::Model& model) {
  return model.dof_count() > 0 &&
         std::ranges::none_of(model.joints, [](const model::Joint& joint) { return joint.slides(0); });
}

/// markers.trc: OpenSim's header, then frames.
class TrcTable {
 public:
  TrcTable(const std::filesystem::path& path, const std::vector<model::Marker>& markers, std::size_t rows,
           double interval)
      : file_(path), digits_(std::to_string(rows)) {
    std::string text =
        "PathFileType\t4\t(X/Y/Z)\tmarkers.trc\n"
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames"
        "\n";
    text += fmt::format("{0:.9g}\t{0:.9g}\t", 1 / interval);
    counts_[0] = static_cast<long>(text.size());
    text += fmt::format("{}\t{}\tm\t{:.9g}\t1\t", digits_, markers.size(), 1 / interval);
    counts_[1] = static_cast<long>(text.size());
    text += digits_ + "\nFrame#\tTime";
    std::string labels;
    for (std::size_t i = 0; i < markers.size(); ++i) {
      text += fmt::format("\t{}\t\t", markers[i].name);
      labels += fmt::format("\tX{0}\tY{0}\tZ{0}", i + 1);
    }
    file_.write(text + "\n\t" + labels + "\n\n");
  }
  void add(double time, const Row& row) {
    file_.write(fmt::format("{}\t{:.12g}\t{}\n", ++rows_, time, fmt::join(row, "\t")));
  }
  void commit() {
    // A run that ends early has fewer frames.
    std::string count = std::to_string(rows_);
    count.resize(std::max(count.size(), digits_.size()), ' ');
    if (count != digits_)
      for (const long at : counts_) file_.overwrite(at, count);
    file_.commit();
  }

 private:
  output::AtomicFile file_;
  std::string digits_;
  std::array<long, 2> counts_{};
  std::size_t rows_ = 0;
};

Row body_row(const model::State& state) {
  Row row;
  for (std::size_t b = 1; b < state.bodies.size(); ++b) {
    const auto& [p, q, v, w] = state.bodies[b];
    append(row, p);
    row.insert(row.end(), {q.w(), q.x(), q.y(), q.z()});
    append(row, v);
    append(row, w);
  }
  return row;
}

/// Mass centre, linear momentum, and angular momentum about the mass centre, of each hand.
Row momentum_row(const model::Model& model, const model::State& state) {
  Row row;
  for (const model::HandIndex& hand : model.hands) {
    const model::Momentum of = model::momentum(model, state, hand.bodies);
    append(row, of.centre);
    append(row, of.linear);
    append(row, of.angular);
  }
  return row;
}

/// Wrist, joint centres and fingertips of all hands in the order of keypoints, by finger from base to tip.
std::vector<model::Marker> table_markers(const model::Model& model) {
  std::vector<model::Marker> out;
  for (const model::HandIndex& hand : model.hands) {
    out.push_back({hand.name + ".wrist", hand.palm, hand.wrist_frame.p});
    for (const int index : hand.joints) {
      const model::Joint& joint = model.joints[as_index(index)];
      if (joint.name == hand.name + ".wrist") continue;
      out.push_back({joint.name, joint.child, joint.child_frame.p});
      for (const model::Fingertip& tip : hand.fingertips)
        if (tip.body == joint.child) out.push_back({tip.name, tip.body, tip.point});
    }
  }
  return out;
}

/// Forces of contact on each body at its centre of mass.
std::vector<model::Wrench> contact_loads(const Simulation& simulation) {
  const model::State& state = simulation.state();
  std::vector<model::Wrench> out(state.bodies.size());
  for (const engine::Contact& contact : simulation.engine().contacts()) {
    const auto add = [&](int shape, const Vec3& force) {
      const std::size_t body = as_index(simulation.model().shapes[as_index(shape)].body);
      out[body].force += force;
      out[body].moment += (contact.position - state.bodies[body].p).cross(force);
    };
    add(contact.shape_a, contact.force);
    add(contact.shape_b, -contact.force);
  }
  return out;
}

}  // namespace

std::vector<std::string> control_columns(const scene::Scene& scene) {
  std::vector<std::string> out;
  if (scene.control)
    for (const control::DrivenAxis& axis : scene.control->axes)
      for (const char* what : {".target[deg]", ".angle[deg]", ".torque[N_m]"})
        out.push_back(axis.name + what);
  return out;
}

std::vector<std::string> muscle_columns(const scene::Scene& scene) {
  std::vector<std::string> out;
  for (const model::Muscle& muscle : scene.model.muscles)
    for (const char* what : kMuscleColumns) out.push_back(muscle.name + what);
  return out;
}

RunTables::RunTables(const Simulation& simulation, const RunOptions& options)
    : simulation_(simulation),
      out_(options.out),
      every_(record_steps(simulation.scene().spec)),
      rows_(static_cast<std::size_t>(record_rows(simulation.steps(), simulation.step_count(), every_))),
      monitored_(options.monitor) {
  const model::Model& model = simulation.model();
  residuals_.fill(kNotMeasured);
  const std::vector<std::string> columns = output::trajectory_columns(model);
  add_csv("trajectory.csv", fmt::format(",{}", fmt::join(columns.begin() + 1, columns.end(), ",")), [this] {
    const Row values = output::trajectory_values(simulation_.state());
    return Row(values.begin() + 1, values.end());
  });
  add_driven();
  if (simulation.scene().spec.record_contacts)
    add_text("contacts.csv", output::contact_head(), [this] {
      std::string rows;
      for (const engine::Contact& contact : simulation_.engine().contacts())
        rows += output::contact_row(simulation_.model(), simulation_.state().time, contact);
      return rows;
    });
  if (monitored_) add_csv("monitor.csv", kMonitorColumns, [this] { return monitor_row(); });
  add_extra();
}

void RunTables::add_text(const char* name, const std::string& head,
                         const std::function<std::string()>& text) {
  const auto file = std::make_shared<output::AtomicFile>(out_ / name);
  file->write(head);
  tables_.push_back({[file, text] { file->write(text()); }, [file] { file->commit(); }});
}

void RunTables::add_csv(const char* name, const std::string& columns, const Numbers& numbers) {
  add_text(name, "time[s]" + columns + "\n", [this, numbers] {
    const std::optional<Row> row = numbers();
    // Twelve digits hide the rounding errors of the time.
    return row ? fmt::format("{:.12g},{}\n", simulation_.state().time, fmt::join(*row, ",")) : "";
  });
}

void RunTables::add_motion(const char* name, std::vector<std::string> columns, const Numbers& numbers) {
  const auto file = std::make_shared<output::MotionTableWriter>(
      out_ / name, output::MotionHead{simulation_.scene().spec.title, std::move(columns), rows_});
  tables_.push_back({[this, file, numbers] { file->add(simulation_.state().time, *numbers()); },
                     [file] { file->finish(); }});
}

/// Joint angles, and what drives them: OpenSim's tables.
void RunTables::add_driven() {
  const scene::Scene& scene = simulation_.scene();
  if (all_angles(scene.model))
    add_motion("trajectory.mot", output::coordinate_names(scene.model), [this] {
      Row row = simulation_.state().q;
      for (double& angle : row) angle *= kDegreesPerRadian;
      return row;
    });
  if (std::vector<std::string> columns = control_columns(scene); !columns.empty())
    add_motion("control.sto", std::move(columns), [this] {
      Row row;
      for (const control::AxisState& axis : simulation_.controller()->axes())
        row.insert(row.end(), {kDegreesPerRadian * axis.target, kDegreesPerRadian * axis.angle, axis.torque});
      return row;
    });
  if (scene.model.muscles.empty()) return;
  add_motion("muscles.sto", muscle_columns(scene), [this] {
    const model::State& state = simulation_.state();
    const std::span<const double> excitations = simulation_.excitations();
    Row row;
    for (std::size_t i = 0; i < state.activation.size(); ++i)
      row.insert(row.end(), {excitations.empty() ? 0 : excitations[i], state.activation[i],
                             state.tendon_force[i], 1e3 * state.fibre_length[i], 1e3 * state.fibre_speed[i]});
    return row;
  });
}

/// Adds the tables that the scene asks for by `record`.
void RunTables::add_extra() {
  const scene::RecordTables& tables = simulation_.scene().spec.tables;
  const model::Model& model = simulation_.model();
  if (tables.bodies)
    add_csv("bodies.csv",
            columns_of(std::span(model.bodies).subspan(1),
                       {"x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz", "vx[m/s]", "vy[m/s]", "vz[m/s]",
                        "wx[rad/s]", "wy[rad/s]", "wz[rad/s]"}),
            [this] { return body_row(simulation_.state()); });
  if (tables.momentum)
    add_csv("momentum.csv",
            columns_of(model.hands, {"x[m]", "y[m]", "z[m]", "px[kg_m/s]", "py[kg_m/s]", "pz[kg_m/s]",
                                     "lx[kg_m2/s]", "ly[kg_m2/s]", "lz[kg_m2/s]"}),
            [this] { return momentum_row(simulation_.model(), simulation_.state()); });
  if (tables.reactions) {
    const bool gravity = simulation_.scene().spec.solver.effects.has(model::Effect::gravity);
    dynamics_.emplace(model, gravity ? model.gravity : Vec3(Vec3::Zero()));
    add_csv("reactions.csv",
            columns_of(model.joints, {"fx[N]", "fy[N]", "fz[N]", "mx[N_m]", "my[N_m]", "mz[N_m]"}),
            [this] { return reaction_row(); });
  }
  if (tables.markers) add_markers();
}

void RunTables::add_markers() {
  const std::vector<model::Marker> points = table_markers(simulation_.model());
  const auto row = [this, points] {
    Row out;
    for (const model::Marker& marker : points)
      append(out, simulation_.state().bodies[as_index(marker.body)].pose() * marker.point);
    return out;
  };
  add_csv("markers.csv", columns_of(points, {"x[m]", "y[m]", "z[m]"}), row);
  const double interval = static_cast<double>(every_) * simulation_.scene().spec.solver.step;
  const auto trc = std::make_shared<TrcTable>(out_ / "markers.trc", points, rows_, interval);
  tables_.push_back(
      {[this, trc, row] { trc->add(simulation_.state().time, row()); }, [trc] { trc->commit(); }});
}

void RunTables::raise_residuals() {
  const engine::StepReport& report = simulation_.last_report();
  // The larger one that is measured.
  const auto raise = [this](std::size_t i, double value) { residuals_[i] = std::fmax(value, residuals_[i]); };
  if (report.contact_sweeps > 0) raise(2, report.contact_residual);
  if (!report.residual) return;
  raise(0, report.residual->linear.value);
  raise(1, report.residual->angular.value);
  raise(2, report.residual->contact.value);
}

RunTables::Row RunTables::monitor_row() {
  const model::State& state = simulation_.state();
  const double kinetic = model::kinetic_energy(simulation_.model(), state);
  const double potential =
      model::potential_energy(simulation_.model(), state, simulation_.scene().spec.solver.effects);
  Row row = {kinetic, potential, kinetic + potential};
  row.insert(row.end(), residuals_.begin(), residuals_.end());
  residuals_.fill(kNotMeasured);
  return row;
}

/// From the change of velocities in the last step; nothing at the start.
std::optional<RunTables::Row> RunTables::reaction_row() {
  if (before_.bodies.size() != simulation_.state().bodies.size()) return std::nullopt;
  dynamics_->place(before_, simulation_.state());
  dynamics_->torques(contact_loads(simulation_));
  Row row;
  for (const model::Wrench& reaction : dynamics_->reactions()) {
    append(row, reaction.force);
    append(row, reaction.moment);
  }
  return row;
}

void RunTables::record(long step) {
  if (monitored_) raise_residuals();
  if (step % every_ == 0)
    for (const Table& table : tables_) table.add();
  if (dynamics_) before_ = simulation_.state();
}

void RunTables::finish() {
  for (const Table& table : tables_) table.finish();
}

std::vector<std::string> extra_table_files() {
  return {"bodies.csv", "markers.csv", "markers.trc", "momentum.csv", "reactions.csv"};
}

double extra_row_bytes(const scene::Scene& scene, double number) {
  const scene::RecordTables& tables = scene.spec.tables;
  double numbers = 0;
  if (tables.bodies) numbers += 13 * static_cast<double>(scene.model.bodies.size());
  if (tables.markers) numbers += 6 * static_cast<double>(table_markers(scene.model).size());
  if (tables.momentum) numbers += 9 * static_cast<double>(scene.model.hands.size());
  if (tables.reactions) numbers += 6 * static_cast<double>(scene.model.joints.size());
  return number * numbers;
}

}  // namespace handsim::simulation
