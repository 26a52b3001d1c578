#include "handsim/study/grasp/agreement.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/report.h"

namespace handsim::study {

namespace {

constexpr const char* kShake = "grasps.0.shake.levels=[{acceleration: 9.8 m/s2, frequency: 2.5 Hz}]";
constexpr double kQuarter = 0.25;

/// Place of the object in the palm, as the scene states it.
Vec3 stated_place(const scene::Scene& scene) {
  Vec3 place = Vec3::Zero();
  const YamlNode* node = scene.resolved.find("grasps");
  if (node == nullptr || node->items.size() != 1)
    throw input_error("scenes", "a scene without a grasp, or with several", "a scene with one grasp");
  node = node->items[0].find("at");
  if (node != nullptr) node = node->find("position");
  if (node == nullptr || node->items.size() != 3) return place;
  for (std::size_t i = 0; i < 3; ++i)
    place[static_cast<Eigen::Index>(i)] = parse_number(node->items[i].text).value_or(0);
  return place;
}

scene::Scene drawn_scene(const AgreementStudy& study, const AgreementRow& row, const char* engine,
                         double step) {
  std::vector<std::string> overrides = study.overrides;
  overrides.push_back(
      fmt::format("grasps.0.at.position=[{}, {}, {}]", row.place.x(), row.place.y(), row.place.z()));
  overrides.push_back(fmt::format("objects.0.mass={}", row.mass));
  overrides.emplace_back(kShake);
  overrides.push_back(fmt::format("solver.engine={}", engine));
  overrides.push_back(fmt::format("solver.step={}", step));
  scene::Scene scene = scene::load_scene(study.scene, overrides);
  set_friction(scene, row.friction);
  return scene;
}

/// The generator's bits as a number from low to high, the same with every library.
double drawn(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * std::ldexp(static_cast<double>(random() >> 11U), -53);
}

std::string agreement_csv(const AgreementTable& table) {
  std::string out = "draw,x[m],y[m],z[m],mass[kg],friction,turning";
  for (const std::string& way : table.ways)
    out += fmt::format(",{0} outcome,{0} margin,{0} slip[um/s],{0} shift[mm],{0} grip[N]", way);
  out += "\n";
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const AgreementRow& row = table.rows[i];
    out += fmt::format("{},{:.5f},{:.5f},{:.5f},{:.4f},{:.4f},{}", i, row.place.x(), row.place.y(),
                       row.place.z(), row.mass, row.friction, quoted(row.turning));
    for (const simulation::GraspFigures& f : row.figures)
      out += fmt::format(",{},{:.4g},{:.4g},{:.4g},{:.5g}", quoted(f.told()), f.margin(), 1e6 * f.slip,
                         1e3 * f.shift, f.hold.normal);
    out += "\n";
  }
  return out;
}

std::string agreement_json(const AgreementTable& table, const AgreementStudy& study) {
  Json out = {{"scene", study.scene.filename().string()}, {"draws", study.draws}, {"seed", study.seed}};
  add_origin(out);
  for (std::size_t a = 0; a < table.ways.size(); ++a)
    for (std::size_t b = a + 1; b < table.ways.size(); ++b) {
      const AgreementTable::Count count = table.agree(a, b);
      const AgreementTable::Difference grip = table.grip(a, b);
      out["pairs"].push_back({{"ways", {table.ways[a], table.ways[b]}},
                              {"same_verdict", count.same},
                              {"not_marginal", count.of},
                              {"grip_difference_median", grip.median},
                              {"grip_difference_most", grip.most}});
    }
  return out.dump(2) + "\n";
}

}  // namespace

AgreementTable::Count AgreementTable::agree(std::size_t way, std::size_t other) const {
  Count out;
  for (const AgreementRow& row : rows) {
    if (!row.turning.empty()) continue;
    ++out.of;
    out.same += row.figures[way].held == row.figures[other].held ? 1 : 0;
  }
  return out;
}

AgreementTable::Difference AgreementTable::grip(std::size_t way, std::size_t other) const {
  std::vector<double> found;
  for (const AgreementRow& row : rows) {
    const simulation::GraspFigures &a = row.figures[way], &b = row.figures[other];
    if (a.held && b.held) found.push_back(std::abs(a.hold.normal / b.hold.normal - 1));
  }
  if (found.empty()) return {};
  std::sort(found.begin(), found.end());
  return {found[found.size() / 2], found.back()};
}

AgreementTable run_agreement(const AgreementStudy& study) {
  const scene::Scene base = scene::load_scene(study.scene, study.overrides);
  const Vec3 place = stated_place(base);
  const double step = base.spec.solver.step;
  const output::OutputFolder folder(study.out, {"agreement.csv", "agreement.json"},
                                    [&] { return scene::files_read(base); });
  folder.clear();
  AgreementTable table;
  table.ways = {"ode", "articulated"};
  if (study.quarter_steps) table.ways.insert(table.ways.end(), {"ode/4", "articulated/4"});
  std::mt19937_64 random(study.seed);
  for (int i = 0; i < study.draws; ++i) {
    AgreementRow& row = table.rows.emplace_back();
    for (int k = 0; k < 3; ++k) row.place[k] = place[k] + drawn(random, -kDrawnShift, kDrawnShift);
    row.mass = drawn(random, kLeastMass, kMostMass);
    row.friction = drawn(random, kLeastFriction, kMostFriction);
    for (std::size_t way = 0; way < table.ways.size(); ++way) {
      const bool articulated = way % 2 == 1;
      const scene::Scene scene =
          drawn_scene(study, row, articulated ? "articulated" : "ode", way < 2 ? step : kQuarter * step);
      row.figures.push_back(simulate(scene).front());
      if (way == 1) row.turning = turning(scene, row.figures.back().held);
      if (study.progress)
        study.progress((i + static_cast<double>(way + 1) / static_cast<double>(table.ways.size())) /
                       study.draws);
    }
    // Hours of work are not lost with the last draw.
    output::write_file(study.out / "agreement.csv", agreement_csv(table));
  }
  output::write_file(study.out / "agreement.json", agreement_json(table, study));
  return table;
}

}  // namespace handsim::study
