#include "handsim/core/archive.h"

#include <bit>
#include <cmath>
#include <cstring>

#include <fmt/format.h>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "handsim/core/error.h"

namespace handsim {

namespace {

constexpr std::size_t kWord = 8;
/// Whether words are the same in memory as in an archive: they are then copied whole, which is faster.
constexpr bool kLittle = std::endian::native == std::endian::little;

}  // namespace

std::uint64_t hash_bytes(std::string_view bytes, std::uint64_t seed) {
  // An empty view may have a null address, which XXH64 must not get.
  const char* data = bytes.data();
  return XXH64(data ? data : "", bytes.size(), seed);
}

void ArchiveWriter::word(std::uint64_t bits) {
  char bytes[kWord];
  if constexpr (kLittle)
    std::memcpy(bytes, &bits, kWord);
  else
    for (std::size_t i = 0; i < kWord; ++i) bytes[i] = static_cast<char>((bits >> (8 * i)) & 0xffU);
  bytes_.append(bytes, kWord);
}

void ArchiveWriter::operator()(double value) { word(std::bit_cast<std::uint64_t>(value)); }

void ArchiveWriter::operator()(const std::string& text) {
  word(text.size());
  bytes_ += text;
}

void ArchiveWriter::operator()(const Vec3& v) {
  for (int i = 0; i < 3; ++i) (*this)(v[i]);
}

void ArchiveWriter::operator()(const Quat& q) {
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) (*this)(value);
}

void ArchiveReader::refuse(const std::string& got, const std::string& need) const {
  throw input_error(name_, got, need);
}

std::uint64_t ArchiveReader::word() {
  if (bytes_.size() < kWord) refuse("a file that ends too early", "a complete one");
  std::uint64_t bits = 0;
  if constexpr (kLittle)
    std::memcpy(&bits, bytes_.data(), kWord);
  else
    for (std::size_t i = 0; i < kWord; ++i)
      bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes_[i])) << (8 * i);
  bytes_.remove_prefix(kWord);
  return bits;
}

std::uint64_t ArchiveReader::count(std::uint64_t limit) {
  const std::uint64_t value = word();
  if (value > limit) refuse(fmt::format("a count of {}", value), fmt::format("at most {}", limit));
  return value;
}

std::size_t ArchiveReader::size() { return count(bytes_.size() < kWord ? 0 : bytes_.size() / kWord - 1); }

void ArchiveReader::operator()(double& value) {
  value = std::bit_cast<double>(word());
  if (!std::isfinite(value)) refuse(fmt::format("{}", value), "a finite number");
}

void ArchiveReader::operator()(std::string& text) {
  const std::uint64_t size = word();
  if (size > bytes_.size()) refuse("a file that ends too early", "a complete one");
  text = bytes_.substr(0, size);
  bytes_.remove_prefix(size);
}

void ArchiveReader::operator()(Vec3& v) {
  for (int i = 0; i < 3; ++i) (*this)(v[i]);
}

void ArchiveReader::operator()(Quat& q) {
  for (double* value : {&q.w(), &q.x(), &q.y(), &q.z()}) (*this)(*value);
}

void ArchiveReader::operator()(bool& value) { value = count(1) != 0; }

void ArchiveReader::finish() const {
  if (!bytes_.empty()) refuse(fmt::format("{} bytes too many", bytes_.size()), "the end of the file");
}

}  // namespace handsim
