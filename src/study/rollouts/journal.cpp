#include "handsim/study/rollouts/journal.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/output/atomic_file.h"

namespace handsim::study {

namespace {

/// To be raised with every change of what is in a journal.
constexpr std::string_view kMark = "HANDROLL 1\n";
constexpr std::size_t kWord = 8;

constexpr std::size_t kFullRecord = std::size_t{1} << 26U;

/// Its length, its hash, and the bytes.
std::string framed(const std::string& bytes) {
  ArchiveWriter head;
  head.word(bytes.size());
  head.word(hash_bytes(bytes));
  return head.take() + bytes;
}

/// A journal record by record: a file of any size takes no more memory than what is in its records.
class Records {
 public:
  Records(const std::filesystem::path& path) : name_(path.string()), size_(regular_size(path)) {
    file_.open(path, std::ios::binary);
    if (read(std::min(size_, kMark.size())) != kMark) refuse("a file that is none, or of another version");
    at_ = kMark.size();
  }

  /// Nothing at the end, and where the last one is torn.
  std::optional<std::string> next() {
    if (size_ - at_ < 2 * kWord) return std::nullopt;
    const std::string bytes = read(2 * kWord);
    ArchiveReader head(bytes, name_);
    const std::uint64_t size = head.word(), hash = head.word();
    // None is empty: zeros are what a crash may leave of a file's end.
    if (size == 0 || size > std::min<std::uint64_t>(size_ - at_ - 2 * kWord, kMostRecord))
      return std::nullopt;
    std::string record = read(size);
    if (hash_bytes(record) != hash) return std::nullopt;
    at_ += 2 * kWord + size;
    return record;
  }
  std::size_t at() const { return at_; }
  /// @throws Error (input) where more is left than one torn record can be.
  void finish() const {
    if (size_ - at_ > kMostRecord)
      refuse(fmt::format("{} bytes after the last whole record, which is at byte {}", size_ - at_, at_));
  }
  [[noreturn]] void refuse(const std::string& got) const {
    throw input_error(name_, got, "a journal of handsim rollouts");
  }

 private:
  std::size_t regular_size(const std::filesystem::path& path) const {
    std::error_code failure;
    if (!std::filesystem::is_regular_file(path, failure)) refuse("no regular file");
    return std::filesystem::file_size(path);
  }
  std::string read(std::size_t size) {
    std::string out(size, '\0');
    if (!file_.read(out.data(), static_cast<std::streamsize>(size))) refuse("a file that cannot be read");
    return out;
  }

  std::string name_;
  std::size_t size_, at_ = 0;
  std::ifstream file_;
};

}  // namespace

JournalContent read_journal(const std::filesystem::path& path) {
  Records records(path);
  JournalContent out;
  const auto head = records.next();
  if (!head) records.refuse("a torn file");
  ArchiveReader of_head(*head, path.string());
  out.head = read_head(of_head);
  of_head.finish();
  while (const auto record = records.next()) {
    ArchiveReader in(*record, path.string());
    for (std::size_t n = in.size(); n > 0; --n) {
      Row& row = out.rows.emplace_back(read_row(in));
      if (row.cells.size() != out.head.columns.size())
        in.refuse(fmt::format("a row of {} cells", row.cells.size()),
                  fmt::format("{}", out.head.columns.size()));
    }
    in.finish();
  }
  records.finish();
  out.bytes = records.at();
  return out;
}

Journal::Journal(std::filesystem::path path, const TableHead& head) : path_(std::move(path)) {
  ArchiveWriter out;
  save(out, head);
  // Has its name when its head is whole.
  output::write_file(path_, std::string(kMark) + framed(out.bytes()));
  file_ = open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
}

Journal::Journal(std::filesystem::path path, const JournalContent& content) : path_(std::move(path)) {
  file_ = open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file_ < 0 || ftruncate(file_, static_cast<off_t>(content.bytes)) != 0) fail();
}

Journal::~Journal() {
  if (file_ >= 0) close(file_);
}

void Journal::add(const std::vector<Row>& rows) {
  std::string records;
  for (auto from = rows.begin(); from != rows.end();) {
    ArchiveWriter of_rows;
    long count = 0;
    // A record with a few long rollouts is as large as one with a thousand short ones.
    for (; from != rows.end() && of_rows.bytes().size() < kFullRecord; ++from, ++count) save(of_rows, *from);
    ArchiveWriter out;
    out(count);
    records += framed(out.bytes() + of_rows.bytes());
  }
  write(records);
}

void Journal::write(const std::string& record) {
  const char* from = record.data();
  std::size_t left = record.size();
  while (left > 0 && file_ >= 0) {
    const ssize_t written = ::write(file_, from, left);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) break;
    from += written;
    left -= static_cast<std::size_t>(written);
  }
  // Data alone: the length goes with it.
  if (file_ >= 0 && left == 0 && fdatasync(file_) == 0) return;
  fail();
}

void Journal::fail() const {
  throw output_error(path_.string(), fmt::format("a file that cannot be written ({})", std::strerror(errno)),
                     "room on the disk; then --resume goes on from what is there");
}

}  // namespace handsim::study
