#include "handsim/simulation/run/extra_tables.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/index.h"
#include "handsim/model/energy.h"
#include "handsim/model/markers.h"
#include "handsim/model/newton_euler.h"

namespace handsim::simulation {

namespace {

using Row = std::vector<double>;

void append(Row& row, const Vec3& v) { row.insert(row.end(), {v.x(), v.y(), v.z()}); }

/// Columns `NAME.part[unit]` for each part.
void add_columns(std::string& head, const std::string& name, std::initializer_list<const char*> parts) {
  for (const char* part : parts) head += fmt::format(",{}.{}", name, part);
}

/// A CSV table whose first line is its header; a time, then numbers.
class CsvTable {
 public:
  CsvTable(const std::filesystem::path& path, const std::string& columns) : file_(path) {
    file_.write("time[s]" + columns + "\n");
  }
  void add(double time, const Row& row) {
    file_.write(fmt::format("{:.12g},{}\n", time, fmt::join(row, ",")));
  }
  void commit() { file_.commit(); }

 private:
  output::AtomicFile file_;
};

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

std::string body_columns(const model::Model& model) {
  std::string out;
  for (std::size_t b = 1; b < model.bodies.size(); ++b)
    add_columns(out, model.bodies[b].name,
                {"x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz", "vx[m/s]", "vy[m/s]", "vz[m/s]", "wx[rad/s]",
                 "wy[rad/s]", "wz[rad/s]"});
  return out;
}

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

std::string momentum_columns(const model::Model& model) {
  std::string out;
  for (const model::HandIndex& hand : model.hands)
    add_columns(out, hand.name,
                {"x[m]", "y[m]", "z[m]", "px[kg_m/s]", "py[kg_m/s]", "pz[kg_m/s]", "lx[kg_m2/s]",
                 "ly[kg_m2/s]", "lz[kg_m2/s]"});
  return out;
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

std::string reaction_columns(const model::Model& model) {
  std::string out;
  for (const model::Joint& joint : model.joints)
    add_columns(out, joint.name, {"fx[N]", "fy[N]", "fz[N]", "mx[N_m]", "my[N_m]", "mz[N_m]"});
  return out;
}

/// Wrist, joint centres and fingertips of all hands in the order of keypoints, by finger from base to tip.
std::vector<model::Marker> table_markers(const model::Model& model) {
  std::vector<model::Marker> out;
  for (const model::HandIndex& hand : model.hands) {
    out.push_back({hand.name + ".wrist", hand.palm, hand.wrist_frame.p});
    for (const int index : hand.joints) {
      const model::Joint& joint = model.joints[at(index)];
      if (joint.name == hand.name + ".wrist") continue;
      out.push_back({joint.name, joint.child, joint.child_frame.p});
      for (const model::Fingertip& tip : hand.fingertips)
        if (tip.body == joint.child) out.push_back({tip.name, tip.body, tip.point});
    }
  }
  return out;
}

}  // namespace

struct ExtraTables::Parts {
  const Simulation& simulation;
  std::vector<model::Marker> points;
  std::optional<CsvTable> bodies, markers, momentum, reactions;
  std::optional<TrcTable> trc;
  std::optional<model::NewtonEuler> dynamics;
  model::State before;  ///< the state at the last step, for reactions
  std::vector<model::Wrench> loads;

  /// Forces of contact on each body at its centre of mass.
  void find_loads() {
    const model::State& state = simulation.state();
    loads.assign(state.bodies.size(), {});
    for (const engine::Contact& contact : simulation.engine().contacts()) {
      const auto add = [&](int shape, const Vec3& force) {
        const std::size_t body = at(simulation.model().shapes[at(shape)].body);
        loads[body].force += force;
        loads[body].moment += (contact.position - state.bodies[body].p).cross(force);
      };
      add(contact.shape_a, contact.force);
      add(contact.shape_b, -contact.force);
    }
  }

  /// From the change of velocities in the last step.
  void add_reactions() {
    find_loads();
    dynamics->place(before, simulation.state());
    dynamics->torques(loads);
    Row row;
    for (const model::Wrench& reaction : dynamics->reactions()) {
      append(row, reaction.force);
      append(row, reaction.moment);
    }
    reactions->add(simulation.state().time, row);
  }

  void add_rows() {
    const model::State& state = simulation.state();
    if (bodies) bodies->add(state.time, body_row(state));
    if (momentum) momentum->add(state.time, momentum_row(simulation.model(), state));
    if (reactions && before.bodies.size() == state.bodies.size()) add_reactions();
    if (!markers) return;
    Row row;
    for (const auto& marker : points) append(row, state.bodies[at(marker.body)].pose() * marker.point);
    markers->add(state.time, row);
    trc->add(state.time, row);
  }
};

ExtraTables::ExtraTables(const Simulation& simulation, const std::filesystem::path& out, std::size_t rows,
                         double interval)
    : parts_(new Parts{simulation, {}, {}, {}, {}, {}, {}, {}, {}, {}}) {
  const scene::RecordTables& tables = simulation.scene().spec.tables;
  const model::Model& model = simulation.model();
  Parts& parts = *parts_;
  if (tables.bodies) parts.bodies.emplace(out / "bodies.csv", body_columns(model));
  if (tables.momentum) parts.momentum.emplace(out / "momentum.csv", momentum_columns(model));
  if (tables.reactions) {
    const bool gravity = simulation.scene().spec.solver.effects.has(model::Effect::gravity);
    parts.dynamics.emplace(model, gravity ? model.gravity : Vec3(Vec3::Zero()));
    parts.reactions.emplace(out / "reactions.csv", reaction_columns(model));
  }
  if (!tables.markers) return;
  parts.points = table_markers(model);
  std::string columns;
  for (const auto& marker : parts.points) add_columns(columns, marker.name, {"x[m]", "y[m]", "z[m]"});
  parts.markers.emplace(out / "markers.csv", columns);
  parts.trc.emplace(out / "markers.trc", parts.points, rows, interval);
}

ExtraTables::~ExtraTables() = default;

void ExtraTables::update(bool row) {
  if (row) parts_->add_rows();
  if (parts_->reactions) parts_->before = parts_->simulation.state();
}

void ExtraTables::finish() {
  for (auto* table : {&parts_->bodies, &parts_->markers, &parts_->momentum, &parts_->reactions})
    if (*table) (*table)->commit();
  if (parts_->trc) parts_->trc->commit();
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
