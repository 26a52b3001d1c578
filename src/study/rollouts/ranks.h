// Rollouts by many processes, on many machines: under mpirun, rank 0 hands out chunks and the others compute.
// Plain send and receive. A rank that dies ends the job, as MPI does; the journal keeps what was done.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace handsim::study {

/// Where rank 0 gets chunks and puts rows.
struct ChunkSource {
  std::string origin;                            ///< that every rank must have
  std::function<std::vector<long>()> next;       ///< the next chunk; empty: none is left
  std::function<void(const std::string&)> take;  ///< a chunk's rows, as bytes
  std::function<bool()> stopped;
};

/// This process among those that mpirun has started; alone where it was started by itself.
class Ranks {
 public:
  /// @throws Error (input) under mpirun where handsim was built without MPI.
  Ranks();
  /// Ends the work of the other ranks.
  ~Ranks();
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }

  /// Of rank 0: hands out chunks until none is left, or `stopped`.
  /// @throws Error (output) naming a rank that has failed or is of another build.
  void serve(const ChunkSource& chunks);
  /// Of the others: computes chunks until there are no more. @param compute a chunk's rows, as bytes.
  void work(const std::string& origin, const std::function<std::string(const std::vector<long>&)>& compute);
  /// Of the others: tells rank 0 why there will be no rows.
  void fail(const std::string& why);

 private:
  struct Messages;
  std::unique_ptr<Messages> messages_;  ///< null where alone
  int rank_ = 0, size_ = 1;
};

}  // namespace handsim::study
