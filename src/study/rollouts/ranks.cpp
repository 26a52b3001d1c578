#include "handsim/study/rollouts/ranks.h"

#include <cstdlib>

#include <fmt/format.h>

#include "handsim/core/error.h"

#ifdef HANDSIM_MPI
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdint>

#include <mpi.h>
#endif

namespace handsim::study {

namespace {

/// Set for each process by OpenMPI's mpirun, and by Slurm's and MPICH's starters.
bool started_with_others() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"})
    if (const char* size = std::getenv(name)) return std::atoi(size) > 1;
  return false;
}

}  // namespace

#ifdef HANDSIM_MPI

namespace {

/// Kinds of messages: the first three of workers, the last of rank 0. An empty chunk ends a worker.
enum Tag : int { kHello = 1, kRows, kFailed, kChunk };

constexpr double kStopWait = 2;  ///< wait for ranks that compute when a run is stopped [s]
/// Between two checks for messages [us]: a rank that waits without pause takes a core of those that compute.
constexpr useconds_t kPause = 50;

}  // namespace

struct Ranks::Messages {
  std::vector<bool> busy;  ///< ranks that still expect chunks
  bool stopped = false;

  bool any_busy() const { return std::ranges::find(busy, true) != busy.end(); }
  static void send(const void* data, std::size_t bytes, int to, int tag) {
    MPI_Send(data, static_cast<int>(bytes), MPI_BYTE, to, tag, MPI_COMM_WORLD);
  }
  /// The next message of any worker; false where there is none yet.
  static bool receive(std::string& text, int& from, int& tag) {
    int there = 0, bytes = 0;
    MPI_Status status;
    MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &there, &status);
    if (there == 0) return false;
    MPI_Get_count(&status, MPI_BYTE, &bytes);
    text.resize(static_cast<std::size_t>(bytes));
    from = status.MPI_SOURCE, tag = status.MPI_TAG;
    MPI_Recv(text.data(), bytes, MPI_BYTE, from, tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    return true;
  }
  void answer(int to, const std::vector<long>& chunk) {
    const std::vector<std::int64_t> numbers(chunk.begin(), chunk.end());
    send(numbers.data(), numbers.size() * sizeof(std::int64_t), to, kChunk);
    if (chunk.empty()) busy[static_cast<std::size_t>(to)] = false;
  }
};

Ranks::Ranks() {
  if (!started_with_others()) return;
  int threads = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &threads);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  messages_ = std::make_unique<Messages>();
  messages_->busy.assign(static_cast<std::size_t>(size_), true);
  messages_->busy[0] = false;
}

Ranks::~Ranks() {
  if (!messages_) return;
  const auto start = std::chrono::steady_clock::now();
  std::string text;
  int from = 0, tag = 0;
  while (rank_ == 0 && messages_->any_busy()) {
    const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
    if (messages_->stopped && waited.count() > kStopWait) MPI_Abort(MPI_COMM_WORLD, 1);
    if (!Messages::receive(text, from, tag))
      usleep(kPause);
    else if (tag == kFailed)
      messages_->busy[static_cast<std::size_t>(from)] = false;
    else
      messages_->answer(from, {});
  }
  MPI_Finalize();
}

void Ranks::serve(const ChunkSource& chunks) {
  if (size_ < 2)
    throw input_error("mpirun", "one process", "two at least: rank 0 hands out, the others compute");
  const auto refuse = [this](int rank, const std::string& why, const std::string& need) {
    messages_->stopped = true;
    throw output_error(fmt::format("rank {}", rank), why, need);
  };
  std::string text;
  int from = 0, tag = 0;
  while (messages_->any_busy()) {
    if (chunks.stopped()) {
      messages_->stopped = true;
      return;
    }
    if (!Messages::receive(text, from, tag)) {
      usleep(kPause);
      continue;
    }
    if (tag == kFailed) {
      messages_->busy[static_cast<std::size_t>(from)] = false;
      refuse(from, text, "a rank that can run the study as rank 0 does");
    }
    if (tag == kHello && text != chunks.origin)
      refuse(from, "another build, study or mathematics library:\n" + text,
             "that of rank 0:\n" + chunks.origin);
    if (tag == kRows) chunks.take(text);
    messages_->answer(from, chunks.next());
  }
}

void Ranks::work(const std::string& origin,
                 const std::function<std::string(const std::vector<long>&)>& compute) {
  Messages::send(origin.data(), origin.size(), 0, kHello);
  while (true) {
    int bytes = 0;
    MPI_Status status;
    MPI_Probe(0, kChunk, MPI_COMM_WORLD, &status);
    MPI_Get_count(&status, MPI_BYTE, &bytes);
    std::vector<std::int64_t> chunk(static_cast<std::size_t>(bytes) / sizeof(std::int64_t));
    MPI_Recv(chunk.data(), bytes, MPI_BYTE, 0, kChunk, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    if (chunk.empty()) return;
    const std::string rows = compute({chunk.begin(), chunk.end()});
    Messages::send(rows.data(), rows.size(), 0, kRows);
  }
}

void Ranks::fail(const std::string& why) { Messages::send(why.data(), why.size(), 0, kFailed); }

#else

struct Ranks::Messages {};

Ranks::Ranks() {
  if (started_with_others())
    throw input_error("mpirun", "a handsim built without MPI",
                      "one built where libopenmpi-dev is installed, or --shard k/n");
}
Ranks::~Ranks() = default;
void Ranks::serve(const ChunkSource& /*chunks*/) {}
void Ranks::work(const std::string& /*origin*/,
                 const std::function<std::string(const std::vector<long>&)>& /*compute*/) {}
void Ranks::fail(const std::string& /*why*/) {}

#endif

}  // namespace handsim::study
