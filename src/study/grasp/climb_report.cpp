#include "handsim/study/grasp/climb_report.h"

#include <fmt/format.h>

#include "handsim/study/report.h"

namespace handsim::study {

std::string climbs_csv(const std::vector<ClimbRow>& rows) {
  std::string out =
      "scene,side,climb,failed,load[N],norm[N],norm_deviation[N],grip_strength[N],load_over_norm,"
      "travel_at_load[mm],contacts,criteria_held,wall[s]\n";
  for (const ClimbRow& row : rows) {
    const simulation::ClimbFigures& f = row.figures;
    out += fmt::format("{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.4g},{:.4g},{},{},{:.3g}\n", row.scene,
                       row.side, f.name, f.failed ? 1 : 0, f.carried, f.strength.norm, f.strength.deviation,
                       f.strength.own, f.share(), 1e3 * f.last.travel, f.last.contacts, row.passed ? 1 : 0,
                       row.wall);
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
    if (!row.fault.empty()) entry["fault"] = row.fault;
    out.push_back(std::move(entry));
  }
  return out.dump(2) + "\n";
}

}  // namespace handsim::study
