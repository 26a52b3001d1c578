// The tables of grasps and climbs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/units.h"
#include "handsim/output/atomic_file.h"
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

void add_person(Json& entry, const RunRow& row) {
  entry["stature_m"] = row.stature;
  entry["hand_length_m"] = row.hand_length;
  // A climb has that of its own table.
  if (!entry.contains("grip_strength_N")) entry["grip_strength_N"] = row.grip_strength;
}

std::string csv(const std::vector<GraspRow>& rows) {
  std::string out =
      "scene,side,stature[m],hand_length[m],grip_strength[N],object,held,outcome,margin,turning,slip[um/"
      "s],shaken_shift[mm],shift[mm],turn[deg],contacts,normal_force[N],friction_used,force_closure,epsilon,"
      "wrench_volume,smallest_friction,criteria_held,wall[s],outcome_half_step,margin_half_step,uncertain\n";
  for (const GraspRow& row : rows) {
    const simulation::GraspFigures& f = row.figures;
    // Empty: not measured.
    const auto cell = [](bool measured, double value) {
      return measured ? fmt::format("{:.6g}", value) : "";
    };
    const bool held = f.hold_measured(), end = f.complete;
    const simulation::WrenchSpace& wrenches = f.after.wrenches;
    const std::vector<std::string> cells = {
        row.scene,
        row.side,
        fmt::format("{:.6g},{:.6g},{:.6g}", row.stature, row.hand_length, row.grip_strength),
        f.name,
        f.held ? "1" : "0",
        quoted(f.told()),
        cell(f.margin_measured(), f.margin()),
        quoted(row.turning.value_or("")),
        cell(held, 1e6 * f.slip),
        cell(held, 1e3 * f.shaken_shift),
        cell(end, 1e3 * f.shift),
        cell(end, kDegreesPerRadian * f.turn),
        cell(end, f.after.contacts),
        cell(end, f.after.normal),
        cell(end, f.after.friction_used),
        cell(end, wrenches.force_closure ? 1 : 0),
        cell(end, wrenches.epsilon),
        cell(end, wrenches.volume),
        cell(row.smallest_friction.has_value(), row.smallest_friction.value_or(0)),
        row.passed ? "1" : "0",
        fmt::format("{:.3g}", row.wall),
        row.half_step ? quoted(row.half_step->told()) : "",
        row.half_step ? cell(row.half_step->margin_measured(), row.half_step->margin()) : "",
        cell(row.half_step.has_value(), row.uncertain())};
    out += fmt::format("{}\n", fmt::join(cells, ","));
  }
  return out;
}

std::string json(const std::vector<GraspRow>& rows, const std::vector<RefusedGrasp>& refused) {
  Json out = Json::array();
  for (const GraspRow& row : rows) {
    const simulation::GraspFigures& f = row.figures;
    const auto known = [](bool measured, auto value) { return measured ? Json(value) : Json(); };
    Json entry = {{"scene", row.scene},
                  {"side", row.side},
                  {"object", f.name},
                  {"held", f.held},
                  {"outcome", f.told()},
                  {"margin", known(f.margin_measured(), f.margin())},
                  {"complete", f.complete},
                  {"criteria_held", row.passed},
                  {"slip_m_per_s", known(f.hold_measured(), f.slip)},
                  {"shaken_shift_m", known(f.hold_measured(), f.shaken_shift)},
                  {"shift_m", known(f.complete, f.shift)},
                  {"turn_rad", known(f.complete, f.turn)},
                  {"contacts", known(f.complete, f.after.contacts)},
                  {"normal_force_N", known(f.complete, f.after.normal)},
                  {"friction_used", known(f.complete, f.after.friction_used)},
                  {"force_closure", known(f.complete, f.after.wrenches.force_closure)},
                  {"force_closure_disagrees", f.disagree()},
                  {"epsilon", known(f.complete, f.after.wrenches.epsilon)},
                  {"wrench_volume", known(f.complete, f.after.wrenches.volume)},
                  {"simulated_s", row.simulated},
                  {"wall_s", row.wall}};
    entry["smallest_friction"] = row.smallest_friction ? Json(*row.smallest_friction) : Json();
    if (!row.not_searched.empty()) entry["not_searched"] = row.not_searched;
    if (f.outcome() == simulation::Outcome::lost) entry["lost_time_s"] = *f.left_time;
    if (f.moved_time) entry["moved_time_s"] = *f.moved_time;
    if (row.turning) entry["turning"] = *row.turning;
    if (row.half_step) {
      const simulation::GraspFigures& half = *row.half_step;
      entry["uncertain"] = row.uncertain();
      entry["half_step"] = {{"outcome", half.told()},
                            {"margin", known(half.margin_measured(), half.margin())},
                            {"slip_m_per_s", known(half.hold_measured(), half.slip)},
                            {"shaken_shift_m", known(half.hold_measured(), half.shaken_shift)},
                            {"shift_m", known(half.complete, half.shift)},
                            {"turn_rad", known(half.complete, half.turn)}};
    }
    add_person(entry, row);
    if (!row.fault.empty()) entry["fault"] = row.fault;
    out.push_back(std::move(entry));
  }
  for (const RefusedGrasp& grasp : refused)
    out.push_back({{"scene", grasp.scene}, {"side", grasp.side}, {"refused", grasp.why}});
  return out.dump(2) + "\n";
}

std::string climbs_csv(const std::vector<ClimbRow>& rows) {
  std::string out =
      "scene,side,stature[m],hand_length[m],climb,failed,load[N],norm[N],norm_deviation[N],grip_strength[N],"
      "load_over_norm,travel_at_load[mm],contacts,criteria_held,wall[s]\n";
  for (const ClimbRow& row : rows) {
    const simulation::ClimbFigures& f = row.figures;
    out += fmt::format("{},{},{:.6g},{:.6g},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.4g},{:.4g},{},{},{:.3g}\n",
                       row.scene, row.side, row.stature, row.hand_length, f.name, f.failed ? 1 : 0, f.carried,
                       f.strength.norm, f.strength.deviation, f.strength.own, f.share(), 1e3 * f.last.travel,
                       f.last.contacts, row.passed ? 1 : 0, row.wall);
  }
  return out;
}

std::string climbs_json(const std::vector<ClimbRow>& rows) {
  Json out = Json::array();
  for (const ClimbRow& row : rows) {
    const simulation::ClimbFigures& f = row.figures;
    Json entry = {{"scene", row.scene},
                  {"side", row.side},
                  {"climb", f.name},
                  {"failed", f.failed},
                  {"load_N", f.carried},
                  {"grip_strength_norm_N", f.strength.norm},
                  {"grip_strength_deviation_N", f.strength.deviation},
                  {"grip_strength_N", f.strength.own},
                  {"load_over_norm", f.share()},
                  {"travel_at_load_m", f.last.travel},
                  {"contacts", f.last.contacts},
                  {"criteria_held", row.passed},
                  {"simulated_s", row.simulated},
                  {"wall_s", row.wall}};
    add_person(entry, row);
    if (!row.fault.empty()) entry["fault"] = row.fault;
    out.push_back(std::move(entry));
  }
  return out.dump(2) + "\n";
}

}  // namespace

void write_grasps(const GraspTables& tables, const std::filesystem::path& out) {
  output::write_file(out / "grasps.csv", csv(tables.grasps));
  output::write_file(out / "grasps.json", json(tables.grasps, tables.refused));
  if (tables.climbs.empty()) return;
  output::write_file(out / "climbs.csv", climbs_csv(tables.climbs));
  output::write_file(out / "climbs.json", climbs_json(tables.climbs));
}

}  // namespace handsim::study
