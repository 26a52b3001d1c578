#include "handsim/app/commands.h"

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <optional>

#include <fmt/format.h>

#include "handsim/app/progress.h"
#include "handsim/core/units.h"
#include "handsim/output/output_folder.h"
#include "handsim/study/rollouts/rollouts.h"

namespace handsim::app {

namespace {

std::atomic<bool> stop_asked = false;

/// The shard of a process that mpirun or srun has started among others, each with one thread.
void take_shard_of_job(study::RolloutOptions& options) {
  for (const auto& [rank, size] :
       {std::pair("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), {"PMI_RANK", "PMI_SIZE"}}) {
    const char *k = std::getenv(rank), *n = std::getenv(size);
    if (!k || !n || std::atoi(n) < 2) continue;
    options.shard = shard_of(fmt::format("{}/{}", std::atoi(k) + 1, n));
    options.threads = std::max(1, options.threads);
    return;
  }
}

void print_end(const study::RolloutsResult& result, const std::filesystem::path& out) {
  print("  {} rollouts in {:.3g} s", result.computed, result.wall);
  if (result.wall > 0 && result.computed > 0)
    print(" ({:.3g} a second)", static_cast<double>(result.computed) / result.wall);
  print("; files in {}", out.string());
}

}  // namespace

const std::atomic<bool>& stop_at_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_asked = true; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
  return stop_asked;
}

study::Shard shard_of(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto k = parse_number(text.substr(0, slash));
  const auto n = slash == std::string::npos ? std::nullopt : parse_number(text.substr(slash + 1));
  const auto whole = [](const std::optional<double>& x) {
    return x && *x == static_cast<int>(*x) && *x >= 1;
  };
  if (!whole(k) || !whole(n) || *k > *n || *n > 1e6)
    throw input_error("--shard", text, "k/n with k from 1 to n, such as 3/16");
  return {static_cast<int>(*k), static_cast<int>(*n)};
}

study::RolloutsSpec rollouts_of(const RolloutsArguments& arguments) {
  if (arguments.spec) return *arguments.spec;
  study::RolloutsSpec spec = arguments.uncertain ? study::uncertain_rollouts(arguments.study)
                                                 : study::load_rollouts(arguments.study);
  spec.set.insert(spec.set.end(), arguments.overrides.begin(), arguments.overrides.end());
  if (arguments.count) spec.count = *arguments.count;
  if (arguments.seed) spec.seed = *arguments.seed;
  return spec;
}

int rollouts_command(const RolloutsArguments& arguments) {
  stop_at_signals();
  study::RolloutOptions options = arguments;
  // A scene's command has no --resume: it goes on by itself, or where it is of recorded motion begins anew.
  if (arguments.uncertain) options.resume = true;
  if (options.shard.whole()) take_shard_of_job(options);
  const study::RolloutStudy study(rollouts_of(arguments));
  print_warnings(study.warnings());
  const std::filesystem::path where = study::shard_folder(options);
  const output::OutputFolder folder(where, study::rollout_files(), [&] {
    std::vector<std::filesystem::path> files = study.files();
    files.push_back(arguments.study);
    return files;
  });
  if (arguments.resume && study::is_complete(study, where)) {
    print("complete already: files in {}\n", where.string());
    return 0;
  }
  const study::RolloutsResult result = with_progress([&](const auto& show) {
    options.progress = show;
    if (std::error_code none; arguments.spec) std::filesystem::remove(where / study::kJournalName, none);
    return study::run_rollouts(study, options, stop_asked, [&] { folder.clear(); });
  });
  if (result.done < result.size) {
    print_error("stopped: {} of {} rollouts are done; the same command{} goes on\n", result.done, result.size,
                arguments.uncertain ? "" : " with --resume");
    return 1;
  }
  const study::StudyCommands commands =
      arguments.spec ? study::StudyCommands{arguments.command}
      : arguments.uncertain
          ? study::uncertain_commands(arguments.study, arguments.overrides, *arguments.count)
          : study::rollouts_commands(arguments.study, arguments.overrides, arguments.seed);
  if (!options.shard.whole()) {
    // For the table of all shards.
    study::write_commands(arguments.out, commands);
    print("shard {}/{}: {} rollouts of {} are done; handsim rollouts merge {} makes the table of all\n",
          options.shard.k, options.shard.n, result.done, study.size(), arguments.out.string());
    return 0;
  }
  study::finish_study(arguments.out, commands, arguments.report);
  print_text(study::rollouts_screen(result.table));
  print_end(result, arguments.out);
  const PlotNote note = plot_note(result.plotted);
  print("{}\n", note.text);
  return note.status;
}

int merge_command(const RolloutsArguments& arguments) {
  const std::filesystem::path out = arguments.out.empty() ? arguments.folders.front() : arguments.out;
  return print_study(study::merge_rollouts(arguments.folders, {out, arguments.report}), out);
}

}  // namespace handsim::app
