#include "handsim/study/stability/stability.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/study/machine.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

/// Points of a course in a plot.
constexpr long kCoursePoints = 400;

/// One run: a case, a way, a step and a choice of every dimension.
struct Job {
  std::size_t of = 0;  ///< index of the case
  const StabilityCase* the_case = nullptr;
  const Way* way = nullptr;
  double step = 0;
  std::filesystem::path scene;
  std::vector<std::string> set;
  std::string variant;
  bool drawn = false;  ///< its course goes into the plot
  std::vector<StabilityRow> rows;
  std::optional<Course> course;
  std::string engine;
};

/// Every combination of the case's dimensions: scenes, what is varied, what is drawn.
std::vector<std::pair<std::filesystem::path, Alternative>> variants(const StabilityCase& of, bool quick) {
  std::vector<std::pair<std::filesystem::path, Alternative>> out;
  for (const std::filesystem::path& scene : of.scenes)
    out.emplace_back(scene, Alternative{of.scenes.size() > 1 ? scene.stem().string() : "", {}});
  const auto cross = [&](const std::vector<Alternative>& dimension) {
    std::vector<std::pair<std::filesystem::path, Alternative>> more;
    for (const auto& [scene, chosen] : out)
      for (const Alternative& alternative : dimension) {
        Alternative both = chosen;
        both.name += (both.name.empty() ? "" : ", ") + alternative.name;
        both.set.insert(both.set.end(), alternative.set.begin(), alternative.set.end());
        more.emplace_back(scene, std::move(both));
      }
    out = std::move(more);
  };
  for (const std::vector<Alternative>& dimension : of.varied) cross(dimension);
  if (of.draws)
    cross(drawn_variants(*of.draws, quick ? of.quick_draws.value_or(of.draws->count) : of.draws->count));
  return out;
}

std::vector<Job> jobs_of(const StabilityCase& of, std::size_t index, bool quick) {
  std::vector<Job> out;
  const auto all = variants(of, quick);
  for (const Way& way : of.ways) {
    if (quick && !way.quick) continue;
    const std::vector<double>& steps = quick && !of.quick_steps.empty() ? of.quick_steps : way.steps;
    for (const double step : steps)
      for (const auto& [scene, alternative] : all) {
        Job job;
        job.of = index;
        job.the_case = &of;
        job.way = &way;
        job.step = step;
        job.scene = scene;
        job.variant = alternative.name;
        job.drawn = of.plot && &alternative == &all.front().second;
        job.set = of.set;
        if (quick) job.set.insert(job.set.end(), of.quick_set.begin(), of.quick_set.end());
        job.set.insert(job.set.end(), way.set.begin(), way.set.end());
        job.set.insert(job.set.end(), alternative.set.begin(), alternative.set.end());
        // A way that is refused for its step says so itself.
        if (!way.refused) job.set.push_back("solver.step=" + number_text(step));
        out.push_back(std::move(job));
      }
  }
  return out;
}

scene::Scene load(const Job& job, const std::vector<std::string>& more = {}) {
  std::vector<std::string> set = job.set;
  set.insert(set.end(), more.begin(), more.end());
  return scene::load_scene(job.scene, set);
}

StabilityRow row_for(const Job& job, const MeasureSpec& spec) {
  const MeasureKind& kind = *measure_kind(spec.kind);
  StabilityRow row;
  row.of_case = job.the_case->name;
  row.measure = spec.name;
  row.way = job.way->name;
  row.step = job.step;
  row.variant = job.variant;
  row.unit = kind.unit;
  row.limit = spec.limit;
  row.at_least = kind.at_least;
  return row;
}

void fill(StabilityRow& row, const std::optional<Figure>& figure) {
  if (!figure) {
    row.where = "nothing to measure";
    return;
  }
  row.value = figure->value;
  row.time = figure->time;
  row.where = figure->where;
}

void fail(StabilityRow& row, const Error& error) {
  row.fault = error.what();
  if (error.fault()) row.time = error.fault()->time;
}

/// A course of at most so many points, of the largest values.
class CourseKeeper {
 public:
  CourseKeeper(std::string label, long steps) : stride_(std::max(1L, steps / kCoursePoints)) {
    course_.label = std::move(label);
  }
  void look(double time, std::optional<double> value) {
    if (value) largest_ = std::max(largest_, std::abs(*value));
    if (looks_++ % stride_ != 0 || !(largest_ >= 0)) return;
    course_.time.push_back(time);
    course_.value.push_back(largest_);
    largest_ = -1;
  }
  Course take() { return std::move(course_); }

 private:
  Course course_;
  long stride_, looks_ = 0;
  double largest_ = -1;
};

std::string label_of(const Job& job) { return fmt::format("{}, {:g} ms", job.way->name, 1e3 * job.step); }

/// One run with all measures that look at it.
void watch(Job& job, const std::vector<const MeasureSpec*>& specs, const std::atomic<bool>& stop) {
  const scene::Scene scene = load(job);
  std::vector<std::unique_ptr<Measure>> measures;
  for (const MeasureSpec* spec : specs) {
    measures.push_back(measure_kind(spec->kind)->make(scene, *spec));
    job.rows.push_back(row_for(job, *spec));
  }
  try {
    Simulation simulation(scene);
    job.engine = simulation.engine().version();
    const Measure* drawn = nullptr;
    for (std::size_t i = 0; i < specs.size(); ++i)
      if (job.drawn && specs[i]->name == *job.the_case->plot) drawn = measures[i].get();
    CourseKeeper course(label_of(job), simulation.step_count());
    const auto look = [&] {
      for (const auto& measure : measures) measure->look(simulation);
      if (drawn) course.look(simulation.state().time, drawn->course());
    };
    look();
    for (long i = 0; i < simulation.step_count() && !stop; ++i) {
      simulation.step();
      look();
    }
    for (std::size_t i = 0; i < measures.size(); ++i) fill(job.rows[i], measures[i]->figure());
    if (drawn) job.course = course.take();
  } catch (const Error& error) {
    if (!error.fault()) throw;
    for (StabilityRow& row : job.rows) fail(row, error);
  }
}

void proceed(Job& job, const MeasureSpec& spec) {
  StabilityRow row = row_for(job, spec);
  try {
    const Figure figure = measure_kind(spec.kind)->procedure(
        [&](const std::vector<std::string>& more) { return load(job, more); }, spec);
    fill(row, figure);
    if (job.drawn && *job.the_case->plot == spec.name) {
      Course course{label_of(job), {}, {}};
      for (const auto& [x, y] : figure.curve) course.time.push_back(x), course.value.push_back(y);
      job.course = std::move(course);
    }
  } catch (const Error& error) {
    if (!error.fault()) throw;
    fail(row, error);
  }
  job.rows.push_back(std::move(row));
}

/// The scene of a way that is to be refused: 0 where it is, with the message asked for.
void refuse(Job& job) {
  MeasureSpec spec;
  spec.kind = "completes", spec.name = "refused";
  StabilityRow row = row_for(job, spec);
  row.value = 1;
  try {
    const scene::Scene scene = load(job);
    const Simulation simulation(scene);
    row.where = "it was accepted";
  } catch (const Error& error) {
    const std::string said = error.what();
    if (error.kind() == ErrorKind::input && said.find(*job.way->refused) != std::string::npos) row.value = 0;
    row.where = said;
  }
  job.rows.push_back(std::move(row));
}

void run(Job& job, const std::atomic<bool>& stop) {
  if (job.way->refused) return refuse(job);
  std::vector<const MeasureSpec*> watched;
  for (const MeasureSpec& spec : job.the_case->measures)
    if (measure_kind(spec.kind)->make) watched.push_back(&spec);
  if (!watched.empty()) watch(job, watched, stop);
  for (const MeasureSpec& spec : job.the_case->measures)
    if (measure_kind(spec.kind)->procedure && !stop) proceed(job, spec);
}

void judge(StabilityRow& row, const StabilityCase& of) {
  const bool known = std::any_of(of.known.begin(), of.known.end(), [&](const KnownShort& entry) {
    return entry.covers(row.way, row.measure, row.step);
  });
  row.verdict = row.within() ? StabilityVerdict::held
                             : (known ? StabilityVerdict::known_short : StabilityVerdict::fell_short);
}

/// Says which case and way a bad scene or override belongs to.
Error in_case(const Job& job, const Error& error) {
  std::vector<Problem> problems = error.problems();
  for (Problem& problem : problems)
    problem.key = fmt::format("{} ({}): {}", job.the_case->name, job.way->name, problem.key);
  return Error(std::move(problems));
}

/// A long study should not end on a bad scene of its last case: every way's first scene that is bad is said
/// before any runs. Of variants that are drawn the first is looked at.
/// @throws Error (input)
void check(const std::vector<Job>& jobs) {
  std::vector<Problem> problems;
  const Job* before = nullptr;
  bool said = false;
  for (const Job& job : jobs) {
    const bool same_way = before && before->the_case == job.the_case && before->way == job.way;
    before = &job;
    if (same_way && (said || job.the_case->draws)) continue;
    said = false;
    if (job.way->refused) continue;
    try {
      const scene::Scene scene = load(job);
      for (const MeasureSpec& spec : job.the_case->measures)
        if (const MeasureKind* kind = measure_kind(spec.kind); kind->make) kind->make(scene, spec);
      const Simulation simulation(scene);
    } catch (const Error& error) {
      if (error.fault()) continue;  // is for the run to say
      const std::vector<Problem> more = in_case(job, error).problems();
      problems.insert(problems.end(), more.begin(), more.end());
      said = true;
    }
  }
  if (!problems.empty()) throw Error(std::move(problems));
}

/// Runs the jobs in threads; the first error of input stops all and is thrown.
class Pool {
 public:
  Pool(std::vector<Job>& jobs, const StabilityOptions& options) : jobs_(jobs), options_(options) {}

  void run_all() {
    const int machine = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    const int count = options_.threads > 0 ? options_.threads : machine;
    std::vector<std::size_t> together, alone;
    for (std::size_t i = 0; i < jobs_.size(); ++i) (jobs_[i].the_case->alone ? alone : together).push_back(i);
    work(together, count);
    work(alone, 1);
  }

 private:
  void work(const std::vector<std::size_t>& list, int count) {
    std::atomic<std::size_t> next = 0;
    const auto worker = [&] {
      for (std::size_t i = next++; i < list.size() && !stop_; i = next++) one(jobs_[list[i]]);
    };
    std::vector<std::thread> threads;
    for (int i = 1; i < count; ++i) threads.emplace_back(worker);
    worker();
    for (std::thread& thread : threads) thread.join();
    if (error_) std::rethrow_exception(error_);
  }
  void one(Job& job) {
    const double start = cpu_now();
    try {
      run(job, stop_);
    } catch (const Error& error) {
      stop_with(std::make_exception_ptr(in_case(job, error)));
    } catch (...) {
      stop_with(std::current_exception());
    }
    for (StabilityRow& row : job.rows) {
      judge(row, *job.the_case);
      row.cpu = cpu_now() - start;
    }
    const std::lock_guard lock(mutex_);
    ++done_;
    if (options_.progress) options_.progress(static_cast<double>(done_) / static_cast<double>(jobs_.size()));
  }
  void stop_with(std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = std::move(error);
    stop_ = true;
  }

  std::vector<Job>& jobs_;
  const StabilityOptions& options_;
  std::mutex mutex_;
  std::exception_ptr error_;
  std::atomic<bool> stop_ = false;
  std::size_t done_ = 0;
};

/// Known shortfalls that were met, and those that were not in any variant.
void find_better(CaseResult& result) {
  for (const KnownShort& known : result.of->known) {
    bool met = false;
    const auto covered = [&](const StabilityRow& row) {
      return known.covers(row.way, row.measure, row.step);
    };
    for (const StabilityRow& row : result.rows)
      met = met || (covered(row) && row.verdict == StabilityVerdict::known_short);
    if (met) {
      result.known.push_back(known.way + ": " + known.why);
      continue;
    }
    for (StabilityRow& row : result.rows)
      if (covered(row) && row.verdict == StabilityVerdict::held) row.verdict = StabilityVerdict::better;
  }
}

std::vector<const StabilityCase*> chosen_cases(const StabilitySpec& spec, const StabilityOptions& options) {
  std::vector<const StabilityCase*> out;
  std::vector<std::string> names;
  for (const StabilityCase& of : spec.cases) names.push_back(of.name);
  for (const std::string& name : options.cases)
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      const auto near = nearest_word(name, names);
      throw input_error(
          "--case", name,
          fmt::format("one of {}{}", fmt::join(names, ", "), near ? " (nearest: " + *near + ")" : ""));
    }
  for (const StabilityCase& of : spec.cases) {
    const bool asked = std::find(options.cases.begin(), options.cases.end(), of.name) != options.cases.end();
    if (asked || (options.cases.empty() && (!options.quick || of.in_quick))) out.push_back(&of);
  }
  return out;
}

}  // namespace

bool KnownShort::covers(const std::string& of_way, const std::string& measure, double step) const {
  const auto here = [&](double known) { return std::abs(known - step) <= 1e-9 * step; };
  return way == of_way && std::find(measures.begin(), measures.end(), measure) != measures.end() &&
         (steps.empty() || std::any_of(steps.begin(), steps.end(), here));
}

double StabilityRow::severity() const {
  if (!value || std::isnan(*value)) return std::numeric_limits<double>::infinity();
  if (at_least) return *value > 0 ? limit / *value : std::numeric_limits<double>::infinity();
  if (limit > 0) return *value / limit;
  return *value <= limit ? 0 : std::numeric_limits<double>::infinity();
}

bool StabilityResult::passed() const {
  return std::all_of(cases.begin(), cases.end(), [](const CaseResult& result) {
    return std::none_of(result.rows.begin(), result.rows.end(),
                        [](const StabilityRow& row) { return row.verdict == StabilityVerdict::fell_short; });
  });
}

StabilityResult run_stability(const StabilitySpec& spec, const StabilityOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  StabilityResult result;
  result.quick = options.quick;
  std::vector<Job> jobs;
  for (const StabilityCase* of : chosen_cases(spec, options)) {
    std::vector<Job> more = jobs_of(*of, result.cases.size(), options.quick);
    std::move(more.begin(), more.end(), std::back_inserter(jobs));
    result.cases.push_back({of, {}, {}, {}});
  }
  check(jobs);
  Pool(jobs, options).run_all();
  for (Job& job : jobs) {
    CaseResult& into = result.cases[job.of];
    std::move(job.rows.begin(), job.rows.end(), std::back_inserter(into.rows));
    if (job.course) into.courses.push_back(std::move(*job.course));
    if (!job.engine.empty() &&
        std::find(result.engines.begin(), result.engines.end(), job.engine) == result.engines.end())
      result.engines.push_back(job.engine);
  }
  for (CaseResult& of : result.cases) find_better(of);
  result.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

std::vector<StabilityRow> worst_rows(const CaseResult& result) {
  std::vector<StabilityRow> out;
  for (const MeasureSpec& measure : result.of->measures)
    for (const StabilityRow& row : result.rows) {
      if (row.measure != measure.name) continue;
      const auto same = std::find_if(out.begin(), out.end(), [&](const StabilityRow& other) {
        return other.measure == row.measure && other.way == row.way && other.step == row.step;
      });
      if (same == out.end())
        out.push_back(row);
      else if (row.severity() > same->severity())
        *same = row;
    }
  for (const StabilityRow& row : result.rows)
    if (row.measure == "refused") out.push_back(row);
  return out;
}

}  // namespace handsim::study
