// The tables of grasps and climbs.
#include <algorithm>

#include "handsim/core/units.h"
#include "handsim/output/atomic_file.h"
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

/// Null where it has not been measured.
Json known(bool measured, Json value) { return measured ? std::move(value) : Json(); }

void add_person(Fields& out, const RunRow& row) {
  out.insert(out.end(),
             {{"stature", "stature_m", row.stature}, {"hand_length", "hand_length_m", row.hand_length}});
  // A climb has that of its own table.
  if (std::ranges::find(out, std::string_view("grip_strength"), &Field::column) == out.end())
    out.push_back({"grip_strength", "grip_strength_N", row.grip_strength});
  if (!row.fault.empty()) out.push_back({"", "fault", row.fault});
}

Json half_step_json(const simulation::GraspFigures& half) {
  return {{"outcome", half.told()},
          {"margin", known(half.margin_measured(), half.margin())},
          {"slip_m_per_s", known(half.hold_measured(), half.slip)},
          {"shaken_shift_m", known(half.hold_measured(), half.shaken_shift)},
          {"shift_m", known(half.complete, half.shift)},
          {"turn_rad", known(half.complete, half.turn)}};
}

Fields fields_of(const GraspRow& row) {
  const simulation::GraspFigures& f = row.figures;
  const simulation::WrenchSpace& wrenches = f.after.wrenches;
  const bool held = f.hold_measured(), end = f.complete;
  Fields out = {{"scene", "scene", row.scene, 1, "{}"},
                {"side", "side", row.side, 1, "{}"},
                {"object", "object", f.name, 1, "{}"},
                {"held", "held", f.held},
                {"outcome", "outcome", f.told()},
                {"margin", "margin", known(f.margin_measured(), f.margin())},
                {"", "complete", end},
                {"criteria_held", "criteria_held", row.passed},
                {"slip", "slip_m_per_s", known(held, f.slip), 1e6},
                {"shaken_shift", "shaken_shift_m", known(held, f.shaken_shift), 1e3},
                {"shift", "shift_m", known(end, f.shift), 1e3},
                {"turn", "turn_rad", known(end, f.turn), kDegreesPerRadian},
                {"contacts", "contacts", known(end, f.after.contacts)},
                {"normal_force", "normal_force_N", known(end, f.after.normal)},
                {"friction_used", "friction_used", known(end, f.after.friction_used)},
                {"force_closure", "force_closure", known(end, wrenches.force_closure)},
                {"", "force_closure_disagrees", f.disagree()},
                {"epsilon", "epsilon", known(end, wrenches.epsilon)},
                {"wrench_volume", "wrench_volume", known(end, wrenches.volume)},
                {"", "simulated_s", row.simulated},
                {"wall", "wall_s", row.wall, 1, "{:.3g}"},
                {"smallest_friction", "smallest_friction",
                 known(row.smallest_friction.has_value(), row.smallest_friction.value_or(0))}};
  if (!row.not_searched.empty()) out.push_back({"", "not_searched", row.not_searched});
  if (f.outcome() == simulation::Outcome::lost) out.push_back({"", "lost_time_s", *f.left_time});
  if (f.moved_time) out.push_back({"", "moved_time_s", *f.moved_time});
  out.push_back({"turning", row.turning ? "turning" : "", row.turning.value_or("")});
  if (const auto& half = row.half_step)
    out.insert(out.end(), {{"uncertain", "uncertain", row.uncertain()},
                           {"", "half_step", half_step_json(*half)},
                           {"outcome_half_step", "", half->told()},
                           {"margin_half_step", "", known(half->margin_measured(), half->margin())}});
  add_person(out, row);
  return out;
}

Fields fields_of(const ClimbRow& row) {
  const simulation::ClimbFigures& f = row.figures;
  Fields out = {{"scene", "scene", row.scene, 1, "{}"},
                {"side", "side", row.side, 1, "{}"},
                {"climb", "climb", f.name, 1, "{}"},
                {"failed", "failed", f.failed},
                {"load", "load_N", f.carried},
                {"norm", "grip_strength_norm_N", f.strength.norm},
                {"norm_deviation", "grip_strength_deviation_N", f.strength.deviation},
                {"grip_strength", "grip_strength_N", f.strength.own},
                {"load_over_norm", "load_over_norm", f.share(), 1, "{:.4g}"},
                {"travel_at_load", "travel_at_load_m", f.last.travel, 1e3, "{:.4g}"},
                {"contacts", "contacts", f.last.contacts},
                {"criteria_held", "criteria_held", row.passed},
                {"", "simulated_s", row.simulated},
                {"wall", "wall_s", row.wall, 1, "{:.3g}"}};
  add_person(out, row);
  return out;
}

/// NAME.csv and NAME.json.
template <class Row>
void write_table(const std::filesystem::path& out, const std::string& name, const char* head,
                 const std::vector<Row>& rows, const std::vector<RefusedGrasp>& refused = {}) {
  std::vector<Fields> fields;
  for (const Row& row : rows) fields.push_back(fields_of(row));
  Json json = json_table(fields);
  for (const RefusedGrasp& grasp : refused)
    json.push_back({{"scene", grasp.scene}, {"side", grasp.side}, {"refused", grasp.why}});
  output::write_file(out / (name + ".csv"), csv_table(head, fields, "{:.6g}"));
  output::write_file(out / (name + ".json"), json.dump(2) + "\n");
}

}  // namespace

void write_grasps(const GraspTables& tables, const std::filesystem::path& out) {
  write_table(out, "grasps",
              "scene,side,stature[m],hand_length[m],grip_strength[N],object,held,outcome,margin,turning,"
              "slip[um/s],shaken_shift[mm],shift[mm],turn[deg],contacts,normal_force[N],friction_used,"
              "force_closure,epsilon,wrench_volume,smallest_friction,criteria_held,wall[s],"
              "outcome_half_step,margin_half_step,uncertain",
              tables.grasps, tables.refused);
  if (tables.climbs.empty()) return;
  write_table(out, "climbs",
              "scene,side,stature[m],hand_length[m],climb,failed,load[N],norm[N],norm_deviation[N],"
              "grip_strength[N],load_over_norm,travel_at_load[mm],contacts,criteria_held,wall[s]",
              tables.climbs);
}

}  // namespace handsim::study
