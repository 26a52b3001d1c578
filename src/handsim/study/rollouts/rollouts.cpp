#include "handsim/study/rollouts/rollouts.h"

#include <algorithm>
#include <chrono>
#include <mutex>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"
#include "handsim/output/table/csv_rows.h"
#include "handsim/simulation/run/output_size.h"

namespace handsim::study {

namespace {

namespace fs = std::filesystem;

/// Bytes of a number and of a text in the journal, in CSV and in HDF5 together.
constexpr double kNumberBytes = 16 + 20 + 8, kTextBytes = 32 + 18 + 56;
/// Bytes of a number in a trajectory, in the journal and in HDF5, and of the name of one of its columns.
constexpr double kStateBytes = 8 + 8, kNameBytes = 40 + 64;
/// Heads of a column, and what plot and summary say of one that is varied.
constexpr double kColumnBytes = 1000, kPanelBytes = 50e3;
constexpr std::size_t kMostSummary = std::size_t{1} << 26U;

long shard_size(long size, const Shard& shard) { return (size - shard.k + shard.n) / shard.n; }

/// Hands out the rollouts that are not done, and keeps what comes back.
class WorkQueue {
 public:
  /// @param done rollouts whose rows are there.
  WorkQueue(const RolloutStudy& study, const RolloutOptions& options, Journal& journal,
            const std::vector<RolloutRow>& rows)
      : options_(options),
        journal_(journal),
        size_(shard_size(study.size(), options.shard)),
        done_(at(size_)) {
    for (const RolloutRow& row : rows) {
      if (row.rollout >= study.size() || row.rollout % options.shard.n != options.shard.k - 1)
        throw input_error(kJournalName, fmt::format("rollout {}", row.rollout), "those of this shard");
      done_[place(row.rollout)] = true;
    }
    count_ = std::ranges::count(done_, true);
    before_ = count_;
  }

  /// The next chunk; empty where all are handed out.
  std::vector<long> next() {
    const std::lock_guard lock(mutex_);
    std::vector<long> out;
    for (; next_ < size_ && static_cast<int>(out.size()) < options_.chunk; ++next_)
      if (!done_[at(next_)]) out.push_back(options_.shard.k - 1 + next_ * options_.shard.n);
    return out;
  }
  void take(std::vector<RolloutRow> rows) {
    if (rows.empty()) return;
    const std::lock_guard lock(mutex_);
    journal_.add(rows);
    for (RolloutRow& row : rows)
      if (!row.curves.columns.empty()) curves_.push_back(std::move(row.curves));
    count_ += static_cast<long>(rows.size());
    if (options_.progress) options_.progress(static_cast<double>(count_) / static_cast<double>(size_));
  }
  long size() const { return size_; }
  long done() const { return count_; }
  long computed() const { return count_ - before_; }
  /// Curves of the rollouts that this run has computed, in any order.
  const std::vector<TimeSeries>& curves() const { return curves_; }

 private:
  std::size_t place(long rollout) const { return at(rollout / options_.shard.n); }

  const RolloutOptions& options_;
  Journal& journal_;
  long size_, next_ = 0, count_ = 0, before_ = 0;
  std::vector<bool> done_;
  std::vector<TimeSeries> curves_;
  std::mutex mutex_;
};

std::vector<RolloutRow> compute(const RolloutStudy& study, const std::vector<long>& chunk,
                                const std::atomic<bool>& stop) {
  std::vector<RolloutRow> out;
  for (const long rollout : chunk)
    if (auto row = study.run(rollout, stop))
      out.push_back(std::move(*row));
    else
      break;
  return out;
}

/// Chunk after chunk in each thread. The first exception ends all, and is thrown.
void run_threads(const RolloutStudy& study, int threads, WorkQueue& queue, const std::atomic<bool>& stop) {
  std::atomic<bool> failed = false;
  in_threads(threads, failed, [&] {
    for (std::vector<long> chunk = queue.next(); !chunk.empty() && !stop && !failed; chunk = queue.next())
      queue.take(compute(study, chunk, stop));
  });
}

/// Parts of the first that the second has not, as `seed 1, study 0123456789abcdef`.
std::string parts_beyond(const TableHead& of, const TableHead& other) {
  std::vector<std::string> out;
  if (of.seed != other.seed) out.push_back("seed " + of.seed);
  if (of.size != other.size) out.push_back(fmt::format("{} rollouts", of.size));
  for (const std::string& part : of.origin)
    if (std::ranges::find(other.origin, part) == other.origin.end()) out.push_back(part);
  return fmt::format("{}", fmt::join(out, ", "));
}

/// @throws Error (input) where two are of different studies.
void check_same(const TableHead& found, const TableHead& wanted, const std::string& file, const char* need) {
  const std::string has = parts_beyond(found, wanted), wants = parts_beyond(wanted, found);
  if (!has.empty() || !wants.empty() || found.columns != wanted.columns)
    throw input_error(file, fmt::format("one of another study or build ({})", has),
                      fmt::format("{} ({})", need, wants));
}

/// What this shard will write; refuses what does not fit.
void check_space(const RolloutStudy& study, const RolloutOptions& options) {
  const double rows = static_cast<double>(shard_size(study.size(), options.shard));
  double bytes = 0;
  for (const Column& column : study.head().columns)
    bytes += rows * (column.text ? kTextBytes : kNumberBytes) + kColumnBytes +
             (column.role == ColumnRole::drawn ? kPanelBytes : 0);
  if (const int recorded = study.spec().trajectories; recorded > 0) {
    const scene::Scene& scene = study.sample();
    const auto records = 1 + scene.spec.duration / scene.spec.solver.step /
                                 static_cast<double>(simulation::record_steps(scene.spec));
    const auto width = static_cast<double>(output::trajectory_columns(scene.model).size());
    if (const double one = width * (8 * records + kNameBytes); one > static_cast<double>(kMostRecord))
      throw input_error("record.trajectories", fmt::format("{:.3g} bytes of a trajectory", one),
                        fmt::format("at most {} (record.every of the scene)", bytes_text(kMostRecord)));
    bytes += std::min<double>(recorded, rows) * width * (records * kStateBytes + kNameBytes);
  }
  // What a journal to be resumed has is there.
  std::error_code missing;
  const auto there = fs::file_size(shard_folder(options) / kJournalName, missing);
  simulation::check_free(missing ? bytes : std::max(0.0, bytes - static_cast<double>(there)), options.out,
                         "fewer rollouts or trajectories");
}

}  // namespace

fs::path shard_folder(const RolloutOptions& options) {
  const Shard& shard = options.shard;
  return shard.whole() ? options.out : options.out / fmt::format("shard_{:02}_of_{:02}", shard.k, shard.n);
}

RolloutsResult run_rollouts(const RolloutStudy& study, const RolloutOptions& options,
                            const std::atomic<bool>& stop, const std::function<void()>& clear) {
  const fs::path file = shard_folder(options) / kJournalName;
  JournalContent content;
  const bool there = fs::exists(file);
  if (there && !options.resume)
    throw input_error(file.string(), "a study that was stopped", "--resume, or another folder");
  check_space(study, options);
  if (there) {
    content = read_journal(file);
    check_same(content.head, study.head(), file.string(), "one of this study, by this build");
  }
  if (clear) clear();
  output::make_folder(file.parent_path());
  RolloutsResult out;
  const auto start = std::chrono::steady_clock::now();
  {
    Journal journal = there ? Journal(file, content) : Journal(file, study.head());
    WorkQueue queue(study, options, journal, content.rows);
    run_threads(study, options.threads, queue, stop);
    out.size = queue.size(), out.done = queue.done(), out.computed = queue.computed();
    // Bands are of all rollouts or not at all.
    if (out.computed == study.size() && !queue.curves().empty())
      output::write_file(options.out / kBandsFile, bands_csv(queue.curves()));
  }
  out.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (out.done < out.size || !options.shard.whole()) return out;
  try {
    out.table = merge_shards({options.out});
    out.plotted = write_rollouts(out.table, options.out);
  } catch (const Error& error) {
    std::vector<Problem> problems = error.problems();
    problems.push_back({std::nullopt, file.string(), fmt::format("{} rows without their table", out.done),
                        "--resume, which writes the table of what is computed"});
    throw Error(std::move(problems), ErrorKind::output);
  }
  std::error_code ignored;
  fs::remove(file, ignored);
  return out;
}

bool is_complete(const RolloutStudy& study, const fs::path& folder) {
  std::error_code failure;
  const fs::path file = folder / "summary.json";
  if (fs::exists(folder / kJournalName, failure) || !fs::is_regular_file(file, failure)) return false;
  const Json json = Json::parse(read_input_file(file, "a summary", kMostSummary), nullptr, false);
  TableHead found;
  try {
    found.origin = json.at("origin").get<std::vector<std::string>>();
    found.size = json.at("rollouts").get<long>();
    found.seed = json.at("seed").get<std::string>();
  } catch (const Json::exception&) {
    throw input_error(file.string(), "a file that is no summary of rollouts",
                      "--resume where this study was stopped, or another folder");
  }
  found.columns = study.head().columns;
  check_same(found, study.head(), file.string(), "the finished one of this study, or another folder");
  return true;
}

Table merge_shards(const std::vector<fs::path>& folders) {
  std::vector<fs::path> files;
  for (const fs::path& folder : folders) {
    const std::size_t before = files.size();
    std::error_code failure;
    if (fs::is_regular_file(folder / kJournalName, failure)) files.push_back(folder / kJournalName);
    for (const auto& entry : fs::directory_iterator(folder, failure))
      if (entry.path().filename().string().starts_with("shard_") &&
          fs::is_regular_file(entry.path() / kJournalName, failure))
        files.push_back(entry.path() / kJournalName);
    if (files.size() == before)
      throw input_error(folder.string(), "a folder without a journal", "the folder of --shard runs");
  }
  std::ranges::sort(files);
  Table out;
  for (const fs::path& file : files) {
    JournalContent content = read_journal(file);
    if (out.head.columns.empty()) out.head = content.head;
    check_same(content.head, out.head, file.string(), "one of the same study, by the same build");
    std::move(content.rows.begin(), content.rows.end(), std::back_inserter(out.rows));
  }
  std::ranges::stable_sort(out.rows,
                           [](const RolloutRow& a, const RolloutRow& b) { return a.rollout < b.rollout; });
  const auto same = [](const RolloutRow& a, const RolloutRow& b) { return a.rollout == b.rollout; };
  out.rows.erase(std::unique(out.rows.begin(), out.rows.end(), same), out.rows.end());
  if (static_cast<long>(out.rows.size()) < out.head.size) {
    long missing = 0;
    while (missing < static_cast<long>(out.rows.size()) && out.rows[at(missing)].rollout == missing)
      ++missing;
    throw input_error("shards",
                      fmt::format("{} of {} rollouts, of which {} is the first that is missing",
                                  out.rows.size(), out.head.size, missing),
                      "all shards, each complete (--resume completes one)");
  }
  return out;
}

}  // namespace handsim::study
