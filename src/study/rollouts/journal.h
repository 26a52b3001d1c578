// What a study has computed so far, as a file: a killed study goes on from it, and shards are merged from
// theirs. Records of rows follow in the order in which they were done; a torn one at the end is left out.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "handsim/study/rollouts/rollout_table.h"

namespace handsim::study {

/// Rollouts k - 1, k - 1 + n, k - 1 + 2 n, ... of a study.
struct Shard {
  int k = 1, n = 1;

  bool whole() const { return n == 1; }
};

inline constexpr const char* kJournalName = "rollouts.journal";

/// Largest record of a journal [bytes]: a rollout that is written whole has to fit.
inline constexpr std::size_t kMostRecord = std::size_t{1} << 30U;

struct JournalContent {
  TableHead head;
  std::vector<Row> rows;  ///< in the order of the file
  std::size_t bytes = 0;  ///< that hold together
};

/// @throws Error (input) for a file that is no journal.
JournalContent read_journal(const std::filesystem::path& path);

class Journal {
 public:
  /// A new one. @throws Error (output) where it cannot be written.
  Journal(std::filesystem::path path, const TableHead& head);
  /// Goes on with one that was read.
  Journal(std::filesystem::path path, const JournalContent& content);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  /// Is on the disk when this returns. @throws Error (output) on a full disk; what was written before stays.
  void add(const std::vector<Row>& rows);

 private:
  void write(const std::string& record);
  [[noreturn]] void fail() const;

  std::filesystem::path path_;
  int file_ = -1;
};

}  // namespace handsim::study
