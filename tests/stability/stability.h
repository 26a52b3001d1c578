// The stability study: scenes that are hard for engines, run with every engine, method and step that the
// study names. Figures are compared with limits from oracles; known shortfalls of an engine do not fail it.
#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/study_run.h"
#include "stability/stability_measures.h"

namespace handsim::study {

/// One alternative of a dimension of variants.
struct Alternative {
  std::string name;              ///< e.g. `erp 0.2`
  std::vector<std::string> set;  ///< overrides of the scene, `key.path=value`
};

/// An engine with its settings.
struct Way {
  std::string name;
  std::vector<std::string> set;
  std::vector<double> steps;  ///< [s]
  /// The engine must reject the scene with a message that contains this text.
  std::optional<std::string> refused;
  bool quick = true;  ///< part of the quick suite
};

/// A known shortfall: limits that a way does not meet, and the reason.
struct KnownShort {
  std::string way;
  std::vector<std::string> measures;  ///< by name
  std::vector<double> steps;          ///< [s]; empty: all steps of the way
  std::string why;

  bool covers(const std::string& of_way, const std::string& measure, double step) const;
};

/// A key of the scene with a random value in each variant of a case.
struct DrawnKey {
  /// A person (1.4 to 2.1 m, 40 to 150 kg, body mass index 14 to 50; all such keys have the same), uniform
  /// over all rotations, uniform between two numbers, one of some texts.
  enum class From { person, rotation, range, choices };
  std::string key;  ///< dotted
  From from = From::range;
  double low = 0, high = 0;
  std::vector<std::string> choices;
};

/// Random variants; a seed always gives the same ones.
struct Draws {
  int count = 0;
  int seed = 1;
  std::vector<DrawnKey> keys;
};

struct StabilityCase {
  std::string name;
  std::string title;   ///< description
  std::string oracle;  ///< the law or closed form that gives the limits
  std::vector<std::filesystem::path> scenes;
  std::vector<std::string> set;                  ///< for every way
  std::vector<std::vector<Alternative>> varied;  ///< every combination is run
  std::vector<MeasureSpec> measures;
  std::vector<Way> ways;
  std::vector<KnownShort> known;
  std::optional<Draws> draws;
  std::optional<double> picture;  ///< time of the picture of the first variant [s]
  bool alone = false;             ///< no other case runs at the same time: it measures the process
  /// False: not part of the quick suite.
  bool in_quick = true;
  std::vector<std::string> quick_set;  ///< overrides in the quick suite
  std::vector<double> quick_steps;  ///< replace the steps of the ways in the quick suite [s]; empty: do not
  std::optional<int> quick_draws;   ///< number of random variants in the quick suite
};

struct StabilitySpec {
  std::string title;
  std::vector<StabilityCase> cases;
};

enum class StabilityVerdict {
  held,         ///< within the limit
  fell_short,   ///< beyond the limit; the study fails
  known_short,  ///< beyond the limit, as a KnownShort says; the study does not fail
  better,       ///< within the limit in all variants, although a KnownShort says otherwise
};

/// A figure of one run.
struct StabilityRow {
  std::string of_case;
  std::string measure;
  std::string way;
  double step = 0;      ///< [s]
  std::string variant;  ///< empty where the case is not varied
  std::string unit;
  double limit = 0;
  bool at_least = false;             ///< true for a lower limit
  std::optional<double> value = {};  ///< absent if the run failed or had nothing to measure
  std::optional<double> time = {};   ///< of the figure, or of the failure [s]
  double cpu = 0;                    ///< CPU time of the whole run [s]
  std::string where = {};            ///< joint, body or circumstance of the figure
  std::string fault = {};            ///< message of a failed run
  std::string command = {};          ///< repeats the run; empty: none does
  StabilityVerdict verdict = StabilityVerdict::held;

  bool within() const { return value && (at_least ? *value >= limit : *value <= limit); }
  /// Figure over limit (inverse for a lower limit): above 1 beyond it, infinite without a figure.
  double severity() const;
};

struct CaseResult {
  const StabilityCase* of = nullptr;
  std::vector<StabilityRow> rows;
  std::vector<std::string> known;  ///< `WAY: why` of each known shortfall that occurred
};

struct StabilityResult {
  std::vector<CaseResult> cases;
  std::vector<std::string> engines;  ///< engines of the rows, with their versions
  double wall = 0;                   ///< wall-clock time [s]
  bool quick = false;

  bool passed() const;
};

struct StabilityOptions {
  std::vector<std::string> cases;  ///< names; empty: all
  bool quick = false;
  int threads = 0;  ///< 0: one for each processor core
  /// Called with the finished share, 0..1; may throw, which ends the study.
  std::function<void(double)> progress;
  bool pictures = true;         ///< of the scenes
  std::filesystem::path study;  ///< file, for stability()
};

/// @throws Error (input) with every problem of the file.
StabilitySpec load_stability(const std::filesystem::path& path);

/// The first `most` random variants.
std::vector<Alternative> drawn_variants(const Draws& draws, int most);

/// A scene of a case with one alternative of every dimension.
struct Variant {
  std::filesystem::path scene;
  std::string name;              ///< empty where the case is not varied
  std::vector<std::string> set;  ///< overrides
};
/// Every combination of the scenes, the dimensions and the random variants.
std::vector<Variant> variants(const StabilityCase& of, bool quick);

/// The spec must outlive the result. @throws Error (input) for unknown cases, invalid scenes and overrides.
StabilityResult run_stability(const StabilitySpec& spec, const StabilityOptions& options);

/// One row for each measure, way and step, in order: the worst of all variants.
std::vector<StabilityRow> worst_rows(const CaseResult& result);

/// The worst rows as a table for the screen.
std::string stability_table(const StabilityResult& result);

/// Writes stability.csv and stability.json (every variant) and, if gnuplot is installed,
/// stability.png and .svg (every figure over its limit).
/// @returns false if gnuplot is missing or fails; the other files and the script stability.gp are written.
/// @throws Error (input) if the folder cannot be written.
bool write_stability(const StabilitySpec& spec, const StabilityResult& result,
                     const std::filesystem::path& out);

/// Draws scene_CASE.png of cases with a picture, and scenes.png, in a child. @return why it failed, if so.
std::optional<std::string> draw_stability(const StabilityResult& result, const std::filesystem::path& out);

/// The whole study. @throws Error (input) as its parts
StudyEnd stability(StabilityOptions options, const StudyRun& run);

}  // namespace handsim::study
