// Serialisation of values to bytes and back.
#include "handsim/core/archive.h"

#include <gtest/gtest.h>

#include <bit>
#include <limits>

#include "handsim/core/error.h"

namespace handsim {
namespace {

ArchiveReader reader(const std::string& bytes) { return {bytes, "saved"}; }

// Oracle: the values written, bit for bit, with the sign of zero and the smallest number.
TEST(Archive, RestoresTheBitsOfEveryKindOfValue) {
  ArchiveWriter out;
  const std::vector<double> numbers = {0.1, -0.0, std::numeric_limits<double>::denorm_min()};
  out(numbers), out(std::string("a\0b", 3)), out(true), out(std::size_t{7}), out(Vec3(1, 2, 3));
  out(Quat(0.5, 0.1, 0.2, 0.3));
  ArchiveReader in = reader(out.bytes());
  std::vector<double> found;
  std::string text;
  bool flag = false;
  std::size_t count = 0;
  Vec3 v;
  Quat q;
  in(found), in(text), in(flag), in(count), in(v), in(q);
  in.finish();
  ASSERT_EQ(found.size(), numbers.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    EXPECT_EQ(std::bit_cast<std::uint64_t>(found[i]), std::bit_cast<std::uint64_t>(numbers[i]));
  EXPECT_EQ(text, std::string("a\0b", 3));
  EXPECT_TRUE(flag);
  EXPECT_EQ(count, 7U);
  EXPECT_EQ(v, Vec3(1, 2, 3));
  EXPECT_EQ(q.coeffs(), Quat(0.5, 0.1, 0.2, 0.3).coeffs());
}

// Oracle: the contract, the same on every machine: eight bytes, least significant first.
TEST(Archive, WritesTheLeastSignificantByteFirst) {
  ArchiveWriter out;
  out.word(0x0102030405060708U);
  EXPECT_EQ(out.bytes(), std::string("\x08\x07\x06\x05\x04\x03\x02\x01", 8));
}

// Oracle: the contract: a count is checked against the remaining bytes before memory is allocated.
TEST(Archive, RefusesIncompleteAndInvalidBytes) {
  ArchiveWriter out;
  out(std::vector<double>{1, 2, 3});
  const std::string whole = out.bytes();
  std::vector<double> values;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::string cut = whole.substr(0, size);
    ArchiveReader in = reader(cut);
    EXPECT_THROW(in(values), Error) << size;
  }
  ArchiveWriter many;
  many.word(kLargestCount);
  ArchiveReader huge = reader(many.bytes());
  EXPECT_THROW(huge(values), Error);
  ArchiveReader half = reader(whole);
  half.word();
  EXPECT_THROW(half.finish(), Error);
  bool flag = false;
  ArchiveReader no_flag = reader(many.bytes());
  EXPECT_THROW(no_flag(flag), Error);
  ArchiveWriter infinite;
  infinite(std::numeric_limits<double>::infinity());
  double value = 0;
  ArchiveReader not_finite = reader(infinite.bytes());
  EXPECT_THROW(not_finite(value), Error);
}

// Oracle: published test vectors of XXH64 (Collet): no bytes with seed 0, and "a".
TEST(Archive, HashesAsXxh64Does) {
  EXPECT_EQ(hash_bytes(""), 0xef46db3751d8e999U);
  EXPECT_EQ(hash_bytes("a"), 0xd24ec4f1a98c6e5bU);
}

}  // namespace
}  // namespace handsim
