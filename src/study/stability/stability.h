// Hard cases: scenes at which engines go wrong, each run by every engine, method and step that the study
// names, and judged by figures with an oracle. Shortfalls of an engine that are known are
// reported beside what holds.
#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "handsim/study/stability/stability_measures.h"

namespace handsim::study {

/// One alternative of a dimension in which a case is varied.
struct Alternative {
  std::string name;              ///< e.g. `erp 0.2`
  std::vector<std::string> set;  ///< overrides
};

/// An engine with its settings.
struct Way {
  std::string name;
  std::vector<std::string> set;
  std::vector<double> steps;  ///< [s]
  /// The scene must be refused with a message that holds this text.
  std::optional<std::string> refused;
  bool quick = true;  ///< part of the quick suite
};

/// What a way is known to fall short of, and why.
struct KnownShort {
  std::string way;
  std::vector<std::string> measures;  ///< by name
  std::vector<double> steps;          ///< [s]; empty: all of the way's
  std::string why;

  bool covers(const std::string& of_way, const std::string& measure, double step) const;
};

/// A key of the scene that every variant of a case draws anew.
struct DrawnKey {
  enum class From {
    person,    ///< 1.4 to 2.1 m, 40 to 150 kg, body mass index 14 to 50; the same for all such keys
    rotation,  ///< even over all rotations
    range,     ///< even between two numbers
    choices    ///< one of some texts
  };
  std::string key;  ///< dotted
  From from = From::range;
  double low = 0, high = 0;
  std::vector<std::string> choices;
};

/// Variants drawn at random: the same ones for the same seed.
struct Draws {
  int count = 0;
  int seed = 1;
  std::vector<DrawnKey> keys;
};

struct StabilityCase {
  std::string name;
  std::string title;   ///< what happens in it
  std::string oracle;  ///< what tells right from wrong
  std::vector<std::filesystem::path> scenes;
  std::vector<std::string> set;                  ///< for every way
  std::vector<std::vector<Alternative>> varied;  ///< every combination is run
  std::vector<MeasureSpec> measures;
  std::vector<Way> ways;
  std::vector<KnownShort> known;
  std::optional<Draws> draws;
  std::optional<std::string> plot;  ///< name of the measure whose course is drawn
  std::optional<double> picture;    ///< time of the first variant that is drawn [s]
  bool alone = false;               ///< runs by itself: it measures the process
  /// For the quick suite: overrides, and steps in place of the ways'. Absent: left out of it.
  bool in_quick = true;
  std::vector<std::string> quick_set;
  std::vector<double> quick_steps;
  std::optional<int> quick_draws;
};

struct StabilitySpec {
  std::string title;
  std::vector<StabilityCase> cases;
};

enum class StabilityVerdict {
  held,
  fell_short,
  known_short,  ///< falls short, as it is known to; does not fail the suite
  better,       ///< known to fall short, but held
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
  bool at_least = false;             ///< the limit is a lower one
  std::optional<double> value = {};  ///< absent where the run failed, or had nothing to measure
  std::optional<double> time = {};   ///< of the figure, or of the failure [s]
  double cpu = 0;                    ///< of the whole run [s]
  std::string where = {};
  std::string fault = {};  ///< what went wrong
  StabilityVerdict verdict = StabilityVerdict::held;

  bool within() const { return value && (at_least ? *value >= limit : *value <= limit); }
  /// How far the figure is from its limit: 1 at the limit, above beyond it, infinity without a figure.
  double severity() const;
};

/// Course of a measure over a run.
struct Course {
  std::string label;
  std::vector<double> time, value;
};

struct CaseResult {
  const StabilityCase* of = nullptr;
  std::vector<StabilityRow> rows;
  std::vector<Course> courses;
  std::vector<std::string> known;  ///< `WAY: why`, of the known shortfalls that occurred
};

struct StabilityResult {
  std::vector<CaseResult> cases;
  std::vector<std::string> engines;  ///< that have rows, each with its version
  double wall = 0;                   ///< [s]
  bool quick = false;

  bool passed() const;
};

struct StabilityOptions {
  std::vector<std::string> cases;  ///< names; empty: all
  bool quick = false;
  int threads = 0;  ///< 0: as many as the machine has
  /// Is called with the share done, 0..1.
  std::function<void(double)> progress;
};

/// @throws Error (input) with every problem of the file.
StabilitySpec load_stability(const std::filesystem::path& path);

/// The variants that a case draws, the first `most` of them.
std::vector<Alternative> drawn_variants(const Draws& draws, int most);

/// A scene of a case with an alternative of every dimension.
struct Variant {
  std::filesystem::path scene;
  std::string name;              ///< empty where the case is not varied
  std::vector<std::string> set;  ///< overrides
};
/// Every combination of the scenes, what is varied and what is drawn.
std::vector<Variant> variants(const StabilityCase& of, bool quick);

/// @throws Error (input) for a case that is not there, and where a scene or an override is bad. The spec must
/// outlive the result.
StabilityResult run_stability(const StabilitySpec& spec, const StabilityOptions& options);

/// Of rows that differ in their variant only, the worst: one row for each measure, way and step, in order.
std::vector<StabilityRow> worst_rows(const CaseResult& result);

/// The rows as a table for the screen: of variants the worst.
std::string stability_table(const StabilityResult& result);

/// One row a case, in Markdown: the worst of what is to hold, and what is known to fall short.
std::string stability_markdown(const StabilityResult& result);

/// Writes stability.csv and stability.json (every variant), stability.md, and, where gnuplot is installed,
/// stability.png and .svg (how far every figure is from its limit) and CASE.png and .svg of cases with a
/// plot.
/// @returns false where gnuplot is missing or failed; its script stability.gp is there all the same.
/// @throws Error (input) where the folder cannot be written.
bool write_stability(const StabilitySpec& spec, const StabilityResult& result,
                     const std::filesystem::path& out);

/// Writes scene_CASE.png of every case of the result with a picture, and all of them on scenes.png, in a
/// process of its own. @return why they are missing; nothing where they are there.
std::optional<std::string> draw_stability(const StabilityResult& result, const std::filesystem::path& out);

/// Names of all files of a study, those of draw_stability among them.
std::vector<std::string> stability_files(const StabilitySpec& spec);

}  // namespace handsim::study
