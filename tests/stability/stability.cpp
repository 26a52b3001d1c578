#include "stability/stability.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/study/report.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

template <class T>
void append(std::vector<T>& to, const std::vector<T>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

template <class T>
bool contains(const std::vector<T>& list, const T& item) {
  return std::ranges::find(list, item) != list.end();
}

/// One run: a case, a way, a step and a variant.
struct Job {
  std::size_t of = 0;  ///< index of the case
  const StabilityCase* the_case = nullptr;
  const Way* way = nullptr;
  double step = 0;
  std::filesystem::path scene;
  std::vector<std::string> set;
  std::string variant;
  std::vector<StabilityRow> rows;
  std::string engine;
};

std::vector<Job> jobs_of(const StabilityCase& of, std::size_t index, bool quick) {
  std::vector<Job> out;
  const std::vector<Variant> all = variants(of, quick);
  for (const Way& way : of.ways) {
    if (quick && !way.quick) continue;
    const std::vector<double>& steps = quick && !of.quick_steps.empty() ? of.quick_steps : way.steps;
    for (const double step : steps)
      for (const Variant& variant : all) {
        Job& job = out.emplace_back(Job{index, &of, &way, step, variant.scene, of.set, variant.name, {}, {}});
        if (quick) append(job.set, of.quick_set);
        append(job.set, way.set);
        append(job.set, variant.set);
        // A way that must be rejected may set an invalid step.
        if (!way.refused) job.set.push_back("solver.step=" + number_text(step));
      }
  }
  return out;
}

scene::Scene load(const Job& job) { return scene::load_scene(job.scene, job.set); }

/// The row of a measure, still without its figure.
StabilityRow row_for(const Job& job, const MeasureSpec& spec) {
  const MeasureKind& kind = *measure_kind(spec.kind);
  return {.of_case = job.the_case->name,
          .measure = spec.name,
          .way = job.way->name,
          .step = job.step,
          .variant = job.variant,
          .unit = std::string(kind.unit),
          .limit = spec.limit,
          .at_least = kind.at_least,
          .command = job.way->refused ? "" : command_text({"run", job.scene.string()}, job.set)};
}

/// One run with all measures.
void measure_run(Job& job, const std::atomic<bool>& stop) {
  const std::vector<MeasureSpec>& specs = job.the_case->measures;
  const scene::Scene scene = load(job);
  std::vector<Measure> measures;
  measures.reserve(specs.size());
  for (const MeasureSpec& spec : specs) {
    measures.emplace_back(scene, spec);
    job.rows.push_back(row_for(job, spec));
  }
  try {
    Simulation simulation(scene);
    job.engine = simulation.engine().version();
    const auto update = [&] {
      for (Measure& measure : measures) measure.update(simulation);
    };
    update();
    for (long i = 0; i < simulation.step_count() && !stop; ++i) {
      simulation.step();
      update();
    }
    for (std::size_t i = 0; i < measures.size(); ++i) {
      const std::optional<Figure> figure = measures[i].figure();
      job.rows[i].where = figure ? figure->where : "nothing to measure";
      if (figure) job.rows[i].value = figure->value, job.rows[i].time = figure->time;
    }
  } catch (const Error& error) {
    if (!error.fault()) throw;
    for (StabilityRow& row : job.rows) row.fault = error.what(), row.time = error.fault()->time;
  }
}

/// Adds a row with 0 if the engine rejects the scene with the expected message, else 1.
void check_rejection(Job& job) {
  MeasureSpec spec;
  spec.kind = "completes", spec.name = "refused";
  StabilityRow row = row_for(job, spec);
  row.value = 1;
  try {
    const scene::Scene scene = load(job);
    const Simulation simulation(scene);
    row.where = "accepted";
  } catch (const Error& error) {
    const std::string message = error.what();
    if (error.kind() == ErrorKind::input && message.find(*job.way->refused) != std::string::npos)
      row.value = 0;
    row.where = message;
  }
  job.rows.push_back(std::move(row));
}

void set_verdict(StabilityRow& row, const StabilityCase& of) {
  const bool known = std::ranges::any_of(
      of.known, [&](const KnownShort& entry) { return entry.covers(row.way, row.measure, row.step); });
  row.verdict = row.within() ? StabilityVerdict::held
                : known      ? StabilityVerdict::known_short
                             : StabilityVerdict::fell_short;
}

/// The error of a scene or override, with its case and way.
Error in_case(const Job& job, const Error& error) {
  std::vector<Problem> problems = error.problems();
  for (Problem& problem : problems)
    problem.key = fmt::format("{} ({}): {}", job.the_case->name, job.way->name, problem.key);
  return Error(std::move(problems));
}

/// Checks scenes before any run, so that a long study does not end with an invalid scene in its last case.
/// Reports the first invalid scene of every way; of random variants, checks only the first one.
/// @throws Error (input)
void check(const std::vector<Job>& jobs) {
  std::vector<Problem> problems;
  const Job* before = nullptr;
  bool reported = false;
  for (const Job& job : jobs) {
    const bool same_way = before && before->the_case == job.the_case && before->way == job.way;
    before = &job;
    if (same_way && (reported || job.the_case->draws)) continue;
    reported = false;
    if (job.way->refused) continue;
    try {
      const scene::Scene scene = load(job);
      for (const MeasureSpec& spec : job.the_case->measures) Measure(scene, spec);
      const Simulation simulation(scene);
    } catch (const Error& error) {
      if (error.fault()) continue;  // the run reports it
      append(problems, in_case(job, error).problems());
      reported = true;
    }
  }
  if (!problems.empty()) throw Error(std::move(problems));
}

/// Runs the jobs in threads, then those that run alone. The first input error ends all and is thrown.
void run_all(std::vector<Job>& jobs, const StabilityOptions& options) {
  std::mutex mutex;
  std::atomic<bool> stop = false;
  std::size_t done = 0;
  const auto run_one = [&](Job& job) {
    const double start = cpu_now();
    try {
      if (job.way->refused)
        check_rejection(job);
      else if (!job.the_case->measures.empty())
        measure_run(job, stop);
    } catch (const Error& error) {
      throw in_case(job, error);
    }
    for (StabilityRow& row : job.rows) {
      set_verdict(row, *job.the_case);
      row.cpu = cpu_now() - start;
    }
    const std::lock_guard lock(mutex);
    ++done;
    if (options.progress && !stop)
      options.progress(static_cast<double>(done) / static_cast<double>(jobs.size()));
  };
  for (const bool alone : {false, true}) {
    std::atomic<std::size_t> next = 0;
    in_threads(alone ? 1 : options.threads, stop, [&] {
      for (std::size_t i = next++; i < jobs.size() && !stop; i = next++)
        if (jobs[i].the_case->alone == alone) run_one(jobs[i]);
    });
  }
}

/// Lists the known shortfalls that occurred, and marks rows of those that occurred in no variant.
void check_known_shortfalls(CaseResult& result) {
  for (const KnownShort& known : result.of->known) {
    const auto mark = [&](StabilityVerdict from, StabilityVerdict to) {
      bool found = false;
      for (StabilityRow& row : result.rows)
        if (row.verdict == from && known.covers(row.way, row.measure, row.step))
          row.verdict = to, found = true;
      return found;
    };
    if (mark(StabilityVerdict::known_short, StabilityVerdict::known_short))
      result.known.push_back(known.way + ": " + known.why);
    else
      mark(StabilityVerdict::held, StabilityVerdict::better);
  }
}

std::vector<const StabilityCase*> chosen_cases(const StabilitySpec& spec, const StabilityOptions& options) {
  std::vector<std::string> names;
  for (const StabilityCase& of : spec.cases) names.push_back(of.name);
  for (const std::string& name : options.cases)
    if (!contains(names, name)) {
      const auto near = nearest_word(name, names);
      throw input_error(
          "--case", name,
          fmt::format("one of {}{}", fmt::join(names, ", "), near ? " (nearest: " + *near + ")" : ""));
    }
  std::vector<const StabilityCase*> out;
  for (const StabilityCase& of : spec.cases)
    if (options.cases.empty() ? !options.quick || of.in_quick : contains(options.cases, of.name))
      out.push_back(&of);
  return out;
}

}  // namespace

bool KnownShort::covers(const std::string& of_way, const std::string& measure, double step) const {
  const auto here = [&](double known) { return std::abs(known - step) <= 1e-9 * step; };
  return way == of_way && contains(measures, measure) && (steps.empty() || std::ranges::any_of(steps, here));
}

double StabilityRow::severity() const {
  if (!value || std::isnan(*value)) return std::numeric_limits<double>::infinity();
  if (at_least) return *value > 0 ? limit / *value : std::numeric_limits<double>::infinity();
  if (limit > 0) return *value / limit;
  return *value <= limit ? 0 : std::numeric_limits<double>::infinity();
}

bool StabilityResult::passed() const {
  return std::ranges::all_of(cases, [](const CaseResult& result) {
    return std::ranges::none_of(
        result.rows, [](const StabilityRow& row) { return row.verdict == StabilityVerdict::fell_short; });
  });
}

StabilityResult run_stability(const StabilitySpec& spec, const StabilityOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  StabilityResult result;
  result.quick = options.quick;
  std::vector<Job> jobs;
  for (const StabilityCase* of : chosen_cases(spec, options)) {
    append(jobs, jobs_of(*of, result.cases.size(), options.quick));
    result.cases.push_back({of, {}, {}});
  }
  check(jobs);
  run_all(jobs, options);
  for (Job& job : jobs) {
    CaseResult& into = result.cases[job.of];
    append(into.rows, job.rows);
    if (!job.engine.empty() && !contains(result.engines, job.engine)) result.engines.push_back(job.engine);
  }
  for (CaseResult& of : result.cases) check_known_shortfalls(of);
  result.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace handsim::study
