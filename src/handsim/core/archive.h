// Serialises numbers and text to bytes and back, bit for bit on any machine: eight bytes per number, least
// significant first. One function template lists the fields of a type for both directions:
//   template <class Archive, class T> void serialize(Archive& archive, T& value) { archive(value.a, value.b);
//   }
// The reader checks every count: it never reads or allocates more than the bytes that are left.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "handsim/core/pose.h"

namespace handsim {

/// Largest count in an archive: a double holds it exactly, and sums of a few counts do not overflow.
inline constexpr std::uint64_t kLargestCount = std::uint64_t{1} << 53U;

/// XXH64 (Collet 2012) of bytes: https://github.com/Cyan4973/xxHash.
std::uint64_t hash_bytes(std::string_view bytes, std::uint64_t seed = 0);

class ArchiveWriter {
 public:
  void operator()(double value);
  void operator()(const std::string& text);
  void operator()(const Vec3& v);
  void operator()(const Quat& q);
  void operator()(const Pose& pose) { (*this)(pose.p, pose.q); }
  void operator()(bool value) { word(value ? 1 : 0); }
  template <std::integral T>
  void operator()(T value) {
    word(static_cast<std::uint64_t>(value));
  }
  template <class T>
  void operator()(const std::vector<T>& values) {
    word(values.size());
    for (const T& value : values) (*this)(value);
  }
  template <class T>
  void operator()(const std::optional<T>& value) {
    (*this)(value.has_value());
    if (value) (*this)(*value);
  }
  template <class A, class B, class... More>
  void operator()(const A& a, const B& b, const More&... more) {
    (*this)(a), (*this)(b), ((*this)(more), ...);
  }
  /// A count, then each element by `serialize(archive, element)`.
  template <class T, class Serialize>
  void list(const std::vector<T>& values, Serialize&& serialize) {
    word(values.size());
    for (const T& value : values) serialize(*this, value);
  }
  /// The elements without a count: the reader knows it.
  template <class Range>
  void each(const Range& values) {
    for (const auto& value : values) (*this)(value);
  }
  void word(std::uint64_t bits);
  const std::string& bytes() const { return bytes_; }
  std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class ArchiveReader {
 public:
  /// @param bytes must outlive the reader. @param name of their content, for messages.
  ArchiveReader(std::string_view bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  // Each throws Error (input) if the bytes end too early or do not hold such a value.
  void operator()(double& value);  ///< finite ones only
  void operator()(std::string& text);
  void operator()(Vec3& v);
  void operator()(Quat& q);  ///< as written; not normalised
  void operator()(Pose& pose) { (*this)(pose.p, pose.q); }
  void operator()(bool& value);
  /// A count or an index, 0 to kLargestCount.
  template <std::integral T>
  void operator()(T& value) {
    constexpr auto kMost = static_cast<std::uint64_t>(std::numeric_limits<T>::max());
    value = static_cast<T>(count(std::min(kLargestCount, kMost)));
  }
  template <class T>
  void operator()(std::vector<T>& values) {
    values.resize(size());
    for (T& value : values) (*this)(value);
  }
  template <class T>
  void operator()(std::optional<T>& value) {
    bool there = false;
    (*this)(there);
    value = there ? std::optional<T>(T()) : std::nullopt;
    if (value) (*this)(*value);
  }
  template <class A, class B, class... More>
  void operator()(A& a, B& b, More&... more) {
    (*this)(a), (*this)(b), ((*this)(more), ...);
  }
  template <class T, class Serialize>
  void list(std::vector<T>& values, Serialize&& serialize) {
    values.resize(size());
    for (T& value : values) serialize(*this, value);
  }
  template <class Range>
  void each(Range& values) {
    for (auto& value : values) (*this)(value);
  }
  std::uint64_t word();
  /// A whole number up to a limit.
  std::uint64_t count(std::uint64_t limit);
  /// Count of the elements that follow, each of at least eight bytes; at most what the bytes left can hold.
  std::size_t size();
  /// @throws Error (input) if bytes are left over.
  void finish() const;
  /// @throws Error (input) with the value found and the value needed.
  [[noreturn]] void refuse(const std::string& got, const std::string& need) const;

 private:
  std::string_view bytes_;
  std::string name_;
};

}  // namespace handsim
