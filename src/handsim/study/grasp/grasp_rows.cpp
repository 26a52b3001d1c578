// What the rows of a study of grasps say, for python/handsim/_grasps.py, which writes its tables.
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

/// Null where it has not been measured.
Json known(bool measured, Json value) { return measured ? std::move(value) : Json(); }

Json figures_json(const simulation::GraspFigures& f) {
  const simulation::WrenchSpace& wrenches = f.after.wrenches;
  const bool lost = f.outcome() == simulation::Outcome::lost, held = f.hold_measured(), end = f.complete;
  return {{"name", f.name},
          {"held", f.held},
          {"word", word(f.outcome())},
          {"told", f.told()},
          {"complete", end},
          {"margin", known(f.margin_measured(), f.margin())},
          {"slip", known(held, f.slip)},
          {"shaken_shift", known(held, f.shaken_shift)},
          {"shift", known(end, f.shift)},
          {"turn", known(end, f.turn)},
          {"contacts", known(end, f.after.contacts)},
          {"normal_force", known(end, f.after.normal)},
          {"friction_used", known(end, f.after.friction_used)},
          {"force_closure", known(end, wrenches.force_closure)},
          {"epsilon", known(end, wrenches.epsilon)},
          {"wrench_volume", known(end, wrenches.volume)},
          {"disagree", f.disagree()},
          {"lost_time", known(lost, f.left_time.value_or(0))},
          {"moved_time", known(f.moved_time.has_value(), f.moved_time.value_or(0))}};
}

Json run_json(const RunRow& row) {
  return {{"scene", row.scene},
          {"side", row.side},
          {"passed", row.passed},
          {"simulated", row.simulated},
          {"wall", row.wall},
          {"fault", row.fault},
          {"stature", row.stature},
          {"hand_length", row.hand_length},
          {"grip_strength", row.grip_strength}};
}

}  // namespace

std::string rows_text(const GraspTables& tables) {
  Json out = {{"grasps", Json::array()},
              {"climbs", Json::array()},
              {"refused", Json::array()},
              {"missing", tables.missing}};
  for (const GraspRow& row : tables.grasps) {
    Json json = run_json(row);
    json["figures"] = figures_json(row.figures);
    json["uncertain"] = row.uncertain();
    json["half_step"] = row.half_step ? figures_json(*row.half_step) : Json();
    json["smallest_friction"] = known(row.smallest_friction.has_value(), row.smallest_friction.value_or(0));
    json["not_searched"] = row.not_searched;
    json["turning"] = known(row.turning.has_value(), row.turning.value_or(""));
    out["grasps"].push_back(std::move(json));
  }
  for (const ClimbRow& row : tables.climbs) {
    const simulation::ClimbFigures& f = row.figures;
    Json json = run_json(row);
    json.update({{"name", f.name},
                 {"failed", f.failed},
                 {"complete", f.complete},
                 {"load", f.carried},
                 {"norm", f.strength.norm},
                 {"norm_deviation", f.strength.deviation},
                 {"own_strength", f.strength.own},
                 {"share", f.share()},
                 {"travel", f.last.travel},
                 {"contacts", f.last.contacts}});
    out["climbs"].push_back(std::move(json));
  }
  for (const RefusedGrasp& grasp : tables.refused)
    out["refused"].push_back({grasp.scene, grasp.side, grasp.why});
  return out.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace handsim::study
