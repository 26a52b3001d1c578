// Random grasps of `handsim grasp --agree` in MuJoCo: `peer_grasps SCENE SEED DRAWS OUT.json`. Controller,
// measures and limits are handsim's; only the engine is another.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include <mujoco/mujoco.h>

#include <nlohmann/json.hpp>

#include "handsim/study/grasp/agreement.h"
#include "handsim/study/grasp/grasp_study.h"
#include "peers/mujoco_engine.h"

namespace {

using namespace handsim;
using Json = nlohmann::json;

struct Way {
  const char* name;
  double step;  ///< [s]
  int noslip;
};

/// Elliptic cones, `impratio` 10, implicit: as `handsim export` writes a scene with friction.
constexpr Way kWays[] = {{"1 ms", 1e-3, 20}, {"0.25 ms", 0.25e-3, 20}};

Json told(const study::AgreementStudy& study, const study::AgreementRow& row, const Way& way) {
  peers::MujocoOptions options{"implicit", true, 10, way.noslip, false, false, true};
  peers::use_engine([options](const model::Model& model, const engine::Settings& settings) {
    return peers::make_mujoco(model, settings, options);
  });
  const scene::Scene scene = study::drawn_scene(study, row, "articulated", way.step);
  const simulation::GraspFigures figures = study::simulate(scene).front();
  Json out = {{"way", way.name},
              {"held", figures.held},
              {"outcome", figures.told()},
              {"slip_m_per_s", figures.slip},
              {"grip_N", figures.hold.normal}};
  out["margin"] = figures.margin_measured() ? Json(figures.margin()) : Json();
  return out;
}

}  // namespace

int main(int count, char** arguments) try {
  if (count != 5) {
    std::fprintf(stderr, "peer_grasps SCENE SEED DRAWS OUT.json\n");
    return 2;
  }
  study::AgreementStudy study;
  study.scene = arguments[1];
  study.seed = std::strtoull(arguments[2], nullptr, 10);
  study.draws = std::atoi(arguments[3]);
  Json draws = Json::array();
  const std::vector<study::AgreementRow> rows = study::drawn_rows(study);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::fprintf(stderr, "draw %zu\n", i);
    draws.push_back({{"draw", i}, {"mass_kg", rows[i].mass}, {"friction", rows[i].friction}});
    for (const Way& way : kWays) draws.back()["says"].push_back(told(study, rows[i], way));
    // Of a run that is stopped there is what it got through.
    std::ofstream(arguments[4]) << Json{{"seed", study.seed},
                                        {"version", std::string("MuJoCo ") + mj_versionString()},
                                        {"draws", draws}}
                                       .dump(1)
                                << "\n";
  }
  return 0;
} catch (const handsim::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
