#include "handsim/study/rollouts/journal.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include <fmt/format.h>

#include "handsim/core/error.h"
#include "handsim/core/input_file.h"
#include "handsim/output/atomic_file.h"

namespace handsim::study {

namespace {

/// To be raised with every change of what is in a journal.
constexpr std::string_view kMark = "HANDROLL 1\n";
constexpr std::size_t kWord = 8;
constexpr std::size_t kMostBytes = std::size_t{64} << 30U;

/// Its length, its hash, and the bytes.
std::string framed(const std::string& bytes) {
  ArchiveWriter head;
  head.word(bytes.size());
  head.word(hash_bytes(bytes));
  return head.take() + bytes;
}

/// The next record of a text; nothing where it is torn.
std::optional<std::string_view> next_record(std::string_view text) {
  if (text.size() < 2 * kWord) return std::nullopt;
  ArchiveReader head(text, "journal");
  const std::uint64_t size = head.word(), hash = head.word();
  text.remove_prefix(2 * kWord);
  if (size > text.size() || hash_bytes(text.substr(0, size)) != hash) return std::nullopt;
  return text.substr(0, size);
}

}  // namespace

JournalContent read_journal(const std::filesystem::path& path) {
  const std::string all = read_input_file(path, "a journal of handsim rollouts", kMostBytes);
  std::string_view text = all;
  const auto refuse = [&](const char* got) {
    throw input_error(path.string(), got, "a journal of handsim rollouts");
  };
  if (!text.starts_with(kMark)) refuse("a file that is none, or of another version");
  text.remove_prefix(kMark.size());
  JournalContent out;
  const auto head = next_record(text);
  if (!head) refuse("a torn file");
  ArchiveReader of_head(*head, path.string());
  out.head = read_head(of_head);
  of_head.finish();
  text.remove_prefix(2 * kWord + head->size());
  while (const auto record = next_record(text)) {
    ArchiveReader in(*record, path.string());
    for (std::size_t n = in.size(); n > 0; --n) {
      Row& row = out.rows.emplace_back(read_row(in));
      if (row.cells.size() != out.head.columns.size())
        in.refuse(fmt::format("a row of {} cells", row.cells.size()),
                  fmt::format("{}", out.head.columns.size()));
    }
    in.finish();
    text.remove_prefix(2 * kWord + record->size());
  }
  out.bytes = all.size() - text.size();
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
  ArchiveWriter out;
  out.list(rows, [](ArchiveWriter& to, const Row& row) { save(to, row); });
  write(framed(out.bytes()));
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
