#include "handsim/study/rollouts/rollout_table.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>

#include <fmt/format.h>

#include "handsim/core/archive.h"
#include "handsim/core/error.h"
#include "handsim/core/units.h"
#include "handsim/output/atomic_file.h"
#include "handsim/study/report.h"
#include "handsim/study/statistics.h"

namespace handsim::study {

namespace {

/// Text of a column, in quotes only where CSV needs them.
std::string field(const std::string& text) {
  return text.find_first_of(",\"\n") == std::string::npos ? text : quoted(text);
}

std::string field(const Cell& cell) {
  if (const double* number = std::get_if<double>(&cell)) return number_text(*number);
  if (const auto* text = std::get_if<std::string>(&cell)) return field(*text);
  return "";
}

// Bits: a figure may be infinite.
void serialize_bits(ArchiveWriter& out, double value) { out.word(std::bit_cast<std::uint64_t>(value)); }
void serialize_bits(ArchiveReader& in, double& value) { value = std::bit_cast<double>(in.word()); }

void serialize_role(ArchiveWriter& out, ColumnRole role) { out(static_cast<int>(role)); }
void serialize_role(ArchiveReader& in, ColumnRole& role) { role = static_cast<ColumnRole>(in.count(4)); }

void serialize_cell(ArchiveWriter& out, const Cell& cell) {
  out(cell.index());
  if (const double* number = std::get_if<double>(&cell)) serialize_bits(out, *number);
  if (const auto* text = std::get_if<std::string>(&cell)) out(*text);
}
void serialize_cell(ArchiveReader& in, Cell& cell) {
  const std::uint64_t kind = in.count(2);
  if (kind == 1) serialize_bits(in, cell.emplace<double>());
  if (kind == 2) in(cell.emplace<std::string>());
}

template <class Archive, class Head>
void serialize_head(Archive& archive, Head& head) {
  archive(head.title, head.size, head.seed);
  archive.list(head.columns, [](auto& each, auto& column) {
    each(column.name);
    serialize_role(each, column.role);
    each(column.text);
  });
  archive(head.origin);
}

template <class Archive, class T>
void serialize_row(Archive& archive, T& row) {
  archive(row.rollout);
  archive.list(row.cells, [](auto& each, auto& cell) { serialize_cell(each, cell); });
  bool recorded = row.trajectory.has_value();
  archive(recorded);
  if (!recorded) return;
  if constexpr (std::same_as<Archive, ArchiveReader>) row.trajectory.emplace();
  archive(row.trajectory->columns);
  archive.list(row.trajectory->values, [](auto& each, auto& value) { serialize_bits(each, value); });
}

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

std::size_t TableHead::column(const std::string& name) const {
  for (std::size_t i = 0; i < columns.size(); ++i)
    if (columns[i].name == name) return i;
  throw input_error("rollouts", "a table without " + name, "one with it");
}

std::string csv_head(const TableHead& head) {
  std::string out;
  for (const Column& column : head.columns) out += (out.empty() ? "" : ",") + field(column.name);
  return out + "\n";
}

std::string csv_row(const TableHead& head, const RolloutRow& row) {
  std::string out;
  for (std::size_t i = 0; i < head.columns.size(); ++i) {
    if (i > 0) out += ',';
    out += field(row.cells[i]);
  }
  return out + "\n";
}

JournalContent read_journal(const std::filesystem::path& path) {
  Records records(path);
  JournalContent out;
  const auto head = records.next();
  if (!head) records.refuse("a torn file");
  ArchiveReader of_head(*head, path.string());
  serialize_head(of_head, out.head);
  of_head.finish();
  while (const auto record = records.next()) {
    ArchiveReader in(*record, path.string());
    for (std::size_t n = in.size(); n > 0; --n) {
      RolloutRow& row = out.rows.emplace_back();
      serialize_row(in, row);
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

std::string bands_csv(const std::vector<TimeSeries>& curves) {
  const auto longer = [](const TimeSeries& a, const TimeSeries& b) {
    return a.values.size() < b.values.size();
  };
  const TimeSeries& longest = *std::ranges::max_element(curves, longer);
  const std::size_t width = longest.columns.size();
  std::string out = field(longest.columns[0]);
  for (std::size_t c = 1; c < width; ++c) {
    const std::string& name = longest.columns[c];
    const std::size_t unit = std::min(name.find('['), name.size());
    for (const char* part : {".p5", ".p50", ".p95"})
      out += "," + field(name.substr(0, unit) + part + name.substr(unit));
  }
  std::vector<double> values;
  for (std::size_t row = 0; row < longest.values.size(); row += width) {
    out += "\n" + number_text(longest.values[row]);
    for (std::size_t c = 1; c < width; ++c) {
      values.clear();
      for (const TimeSeries& each : curves)
        if (row + c < each.values.size()) values.push_back(each.values[row + c]);
      std::ranges::sort(values);
      for (const double share : {0.05, 0.5, 0.95}) out += fmt::format(",{:.7g}", quantile(values, share));
    }
  }
  return out + "\n";
}

Journal::Journal(std::filesystem::path path, const TableHead& head) : path_(std::move(path)) {
  ArchiveWriter out;
  serialize_head(out, head);
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

void Journal::add(const std::vector<RolloutRow>& rows) {
  std::string records;
  for (auto from = rows.begin(); from != rows.end();) {
    ArchiveWriter of_rows;
    long count = 0;
    // A record with a few long rollouts is as large as one with a thousand short ones.
    for (; from != rows.end() && of_rows.bytes().size() < kFullRecord; ++from, ++count)
      serialize_row(of_rows, *from);
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
