#include "handsim/study/grasp/agreement.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>
#include <random>
#include <thread>

#include <fmt/format.h>

#include "handsim/core/units.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/grasp/grasp_study.h"
#include "handsim/study/machine.h"
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
  std::vector<std::string> overrides = drawn_overrides(study, row);
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

/// The same grasps whatever runs them. A draw that the scene's grip refuses is replaced by the next one.
void draw(const AgreementStudy& study, const Vec3& place, double step, AgreementTable& table) {
  std::mt19937_64 random(study.seed);
  const auto draws = static_cast<std::size_t>(study.draws);
  while (table.rows.size() < draws) {
    AgreementRow row;
    for (int k = 0; k < 3; ++k) row.place[k] = place[k] + drawn(random, -kDrawnShift, kDrawnShift);
    row.mass = drawn(random, kLeastMass, kMostMass);
    row.friction = drawn(random, kLeastFriction, kMostFriction);
    try {
      (void)drawn_scene(study, row, "articulated", step);
      table.rows.push_back(row);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::input || table.refused.size() > draws) throw;
      table.refused.emplace_back(error.what());
    }
  }
}

void run_row(const AgreementStudy& study, double step, bool quarters, AgreementRow& row) {
  const double start = cpu_now();
  for (std::size_t way = 0; way < kWays.size(); ++way) {
    if (way == 3 && !quarters && !row.differs()) break;
    const bool articulated = way == 1 || way == 2;
    const scene::Scene scene =
        drawn_scene(study, row, articulated ? "articulated" : "ode", way < 2 ? step : kQuarter * step);
    row.figures.push_back(simulate(scene).front());
    // On the engine that costs little, of every row alike.
    if (way == 1) row.turning = turning(scene, row.figures.back().held);
  }
  row.cpu = cpu_now() - start;
}

std::string agreement_csv(const std::vector<AgreementRow>& rows) {
  std::string out = "draw,x[m],y[m],z[m],mass[kg],friction,turning";
  for (const char* way : kWays)
    out += fmt::format(",{0} outcome,{0} margin,{0} slip[um/s],{0} shift[mm],{0} grip[N]", way);
  out += ",cpu[s]\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const AgreementRow& row = rows[i];
    if (!row.done()) continue;
    out += fmt::format("{},{:.5f},{:.5f},{:.5f},{:.4f},{:.4f},{}", i, row.place.x(), row.place.y(),
                       row.place.z(), row.mass, row.friction, quoted(row.turning));
    for (std::size_t way = 0; way < kWays.size(); ++way) {
      if (way >= row.figures.size()) {
        out += ",,,,,";
        continue;
      }
      const simulation::GraspFigures& f = row.figures[way];
      out += fmt::format(",{},{},{:.4g},{:.4g},{:.5g}", quoted(f.told()),
                         f.margin_measured() ? fmt::format("{:.4g}", f.margin()) : "", 1e6 * f.slip,
                         1e3 * f.shift, f.hold.normal);
    }
    out += fmt::format(",{:.3g}\n", row.cpu);
  }
  return out;
}

Json pair_json(const AgreementTable& table, std::size_t way, std::size_t other) {
  const AgreementTable::Pair pair = table.compare(way, other);
  const auto count = [](const AgreementTable::Count& of) { return Json{{"same", of.same}, {"of", of.of}}; };
  return {{"ways", {kWays[way], kWays[other]}},
          {"same_verdict", count(pair.all)},
          {"same_verdict_not_marginal", count(pair.clear)},
          {"grip_within_a_tenth", count(pair.grip_within)},
          {"grip_difference_median", pair.grip_median},
          {"grip_difference_most", pair.grip_most},
          {"slip_median_m_per_s", {pair.slip, pair.other_slip}},
          {"slip_below_floor", pair.slip_below},
          {"slip_within_a_tenth", count(pair.slip_within)}};
}

/// A grasp of which the engines differ, with what each says of it.
Json difference_json(const AgreementRow& row, std::size_t index) {
  Json out = {{"draw", index},
              {"place_m", {row.place.x(), row.place.y(), row.place.z()}},
              {"mass_kg", row.mass},
              {"friction", row.friction},
              {"turning", row.turning}};
  for (std::size_t way = 0; way < row.figures.size(); ++way)
    out["says"].push_back(
        {{"way", kWays[way]},
         {"outcome", row.figures[way].told()},
         {"held", row.figures[way].held},
         {"margin", row.figures[way].margin_measured() ? Json(row.figures[way].margin()) : Json()}});
  return out;
}

std::string agreement_json(const AgreementTable& table, const AgreementStudy& study) {
  Json out = {{"scene", study.scene.filename().string()},
              {"draws", table.done()},
              {"seed", study.seed},
              {"quarter_steps", table.quarter_rows},
              {"refused", table.refused},
              {"slip_floor_m_per_s", kSlipFloor}};
  add_origin(out);
  double cpu = 0;
  for (const AgreementRow& row : table.rows) cpu += row.cpu;
  out["cpu_s"] = cpu;
  out["pairs"] = Json::array();
  for (const auto& [way, other] : agreement_pairs(table))
    out["pairs"].push_back(pair_json(table, way, other));
  out["differences"] = Json::array();
  for (std::size_t i = 0; i < table.rows.size(); ++i)
    if (table.rows[i].differs()) out["differences"].push_back(difference_json(table.rows[i], i));
  return out.dump(2) + "\n";
}

/// Runs the rows in threads. The first error stops all and is thrown.
class RowPool {
 public:
  RowPool(const AgreementStudy& study, double step, AgreementTable& table)
      : study_(study), step_(step), table_(table) {}

  void run_all() {
    const int machine = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    std::vector<std::thread> others;
    for (int i = 1; i < (study_.threads > 0 ? study_.threads : machine); ++i)
      others.emplace_back([this] { work(); });
    work();
    for (std::thread& thread : others) thread.join();
    if (error_) std::rethrow_exception(error_);
  }

 private:
  void work() {
    for (std::size_t i = next_++; i < table_.rows.size() && !stop_; i = next_++) {
      AgreementRow row = table_.rows[i];
      std::exception_ptr error;
      try {
        run_row(study_, step_, i < table_.quarter_rows, row);
      } catch (...) {
        error = std::current_exception();
      }
      const std::lock_guard lock(mutex_);
      try {
        if (error) std::rethrow_exception(error);
        take_in(i, std::move(row));
      } catch (...) {
        if (!error_) error_ = std::current_exception();
        stop_ = true;
      }
    }
  }
  void take_in(std::size_t index, AgreementRow row) {
    table_.rows[index] = std::move(row);
    ++done_;
    if (study_.progress)
      study_.progress(static_cast<double>(done_) / static_cast<double>(table_.rows.size()));
    // Hours of work are not lost with the last draw.
    output::write_file(study_.out / "agreement.csv", agreement_csv(table_.rows));
    output::write_file(study_.out / "agreement.json", agreement_json(table_, study_));
  }

  const AgreementStudy& study_;
  double step_;  ///< of the scene [s]
  AgreementTable& table_;
  std::atomic<std::size_t> next_ = 0;
  std::atomic<bool> stop_ = false;
  std::size_t done_ = 0;
  std::mutex mutex_;
  std::exception_ptr error_;
};

}  // namespace

std::vector<std::string> drawn_overrides(const AgreementStudy& study, const AgreementRow& row) {
  std::vector<std::string> out = study.overrides;
  out.push_back(
      fmt::format("grasps.0.at.position=[{}, {}, {}]", row.place.x(), row.place.y(), row.place.z()));
  out.push_back(fmt::format("objects.0.mass={}", row.mass));
  out.emplace_back(kShake);
  return out;
}

std::vector<std::pair<std::size_t, std::size_t>> agreement_pairs(const AgreementTable& table) {
  if (table.quarter_rows == 0) return {{0, 1}, {1, 2}};
  return {{0, 1}, {1, 2}, {0, 3}, {2, 3}};
}

std::size_t AgreementTable::done() const {
  return static_cast<std::size_t>(
      std::count_if(rows.begin(), rows.end(), [](const auto& row) { return row.done(); }));
}

AgreementTable::Pair AgreementTable::compare(std::size_t way, std::size_t other) const {
  constexpr double kTenth = 0.1;
  Pair out;
  std::vector<double> grips, slips, other_slips;
  const bool quarter_of_ode = std::max(way, other) == kWays.size() - 1;
  for (std::size_t i = 0; i < (quarter_of_ode ? quarter_rows : rows.size()); ++i) {
    if (!rows[i].done()) continue;
    const simulation::GraspFigures &a = rows[i].figures[way], &b = rows[i].figures[other];
    const int same = a.held == b.held ? 1 : 0;
    for (Count* count : {&out.all, rows[i].turning.empty() ? &out.clear : nullptr})
      if (count != nullptr) *count = {count->same + same, count->of + 1};
    if (!a.held || !b.held) continue;
    grips.push_back(std::abs(a.hold.normal / b.hold.normal - 1));
    out.grip_within.same += grips.back() <= kTenth ? 1 : 0;
    ++out.grip_within.of;
    slips.push_back(a.slip);
    other_slips.push_back(b.slip);
    const double most = std::max(a.slip, b.slip);
    if (most < kSlipFloor) {
      ++out.slip_below;
    } else {
      out.slip_within.same += std::abs(a.slip - b.slip) <= kTenth * most ? 1 : 0;
      ++out.slip_within.of;
    }
  }
  if (grips.empty()) return out;
  out.grip_median = median(grips);
  out.grip_most = *std::max_element(grips.begin(), grips.end());
  out.slip = median(slips);
  out.other_slip = median(other_slips);
  return out;
}

AgreementTable run_agreement(const AgreementStudy& study) {
  const scene::Scene base = scene::load_scene(study.scene, study.overrides);
  const output::OutputFolder folder(study.out,
                                    {"agreement.csv", "agreement.json", "study.json", "report.html"},
                                    [&] { return scene::files_read(base); });
  AgreementTable table;
  draw(study, stated_place(base), base.spec.solver.step, table);
  table.quarter_rows =
      std::min(static_cast<std::size_t>(std::max(study.quarter_steps, 0)), table.rows.size());
  folder.clear();
  RowPool(study, base.spec.solver.step, table).run_all();
  return table;
}

}  // namespace handsim::study
