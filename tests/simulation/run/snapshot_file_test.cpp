#include "handsim/simulation/run/snapshot_file.h"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "handsim/core/archive.h"
#include "simulation/run/snapshot_cases.h"

namespace handsim::simulation {
namespace {

using test::shipped_scene;
using test_cases::Case;
using test_cases::cases;
using test_cases::steps;

/// A snapshot's bytes, changed, with the sum that they then need.
std::string resealed(std::string text) {
  text.resize(text.size() - 8);
  ArchiveWriter sum;
  sum.word(hash_bytes(text));
  return text + sum.bytes();
}

TEST(SnapshotFile, TornChangedOrOfAnotherVersionIsRefused) {
  const scene::Scene scene = shipped_scene("dropped_hand");
  Simulation simulation(scene);
  steps(simulation, 200);
  const std::string text = snapshot_text(simulation.snapshot());
  EXPECT_NO_THROW(parse_snapshot(text, "whole"));
  for (std::size_t size = 0; size < text.size(); size += 1 + size / 50)
    EXPECT_THROW(parse_snapshot(text.substr(0, size), "torn"), Error) << size;
  EXPECT_THROW(parse_snapshot(text + "x", "longer"), Error);
  for (std::size_t at = 0; at < text.size(); at += 7) {
    std::string changed = text;
    changed[at] = static_cast<char>(changed[at] ^ 0x10);
    EXPECT_THROW(parse_snapshot(changed, "changed"), Error) << at;
  }
  std::string later = text;
  ++later[8];
  try {
    parse_snapshot(resealed(later), "later");
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("version " + std::to_string(kSnapshotVersion + 1)),
              std::string::npos)
        << error.what();
  }
  // Any length, sum right: whatever the counts in it say.
  for (std::size_t size = 24; size < text.size(); size += 1 + size / 50)
    EXPECT_THROW(parse_snapshot(resealed(text.substr(0, size)), "shortened"), Error) << size;
}

// Oracle: the sizes as they were when the version was last raised. Where one differs, raise kSnapshotVersion
// and write the new ones here.
TEST(SnapshotFile, OfThisVersionHasTheContentsItHadWhenTheVersionWasRaised) {
  const std::map<std::string, std::size_t> sizes = {
      {"contact_world_step", 3248},  {"controlled", 14928}, {"stabilised_gear", 1072},
      {"articulated_contact", 7160}, {"grasp", 8256},       {"climb", 7984},
      {"contact_record", 3288}};
  EXPECT_EQ(kSnapshotVersion, 14U);
  for (const Case& what : cases()) {
    const auto size = sizes.find(what.name);
    if (size == sizes.end()) continue;
    // Of the start: no contact is in it, whose number another compiler may change.
    EXPECT_EQ(Simulation(shipped_scene(what.scene, what.overrides)).snapshot().bytes.size(), size->second)
        << what.name;
  }
}

// Whatever stands in the bytes: an input error that leaves the simulation as it was, or a state to go on
// from, to the end or to a physics fault.
TEST(SnapshotFile, WithAnyNumbersInItEndsInATypedErrorOrAState) {
  std::mt19937_64 random(20);
  int refused = 0, taken = 0;
  for (const Case& what : cases()) {
    static const std::set<std::string> kTried = {
        "contact_world_step", "contact_record",      "controlled",        "stabilised_gear",
        "lagrange_penalty",   "loop_dormand_prince", "articulated_stops", "articulated_contact"};
    if (!kTried.contains(what.name)) continue;
    const scene::Scene scene = shipped_scene(what.scene, what.overrides);
    Simulation simulation(scene);
    steps(simulation, 150);
    const RunSnapshot good = simulation.snapshot();
    for (int round = 0; round < 100; ++round) {
      RunSnapshot bad = good;
      for (std::uint64_t n = 1 + random() % 3; n > 0; --n) {
        const std::size_t word = 8 * (random() % (bad.bytes.size() / 8));
        const std::array<std::uint64_t, 6> values = {random(),
                                                     random() % 100,
                                                     std::bit_cast<std::uint64_t>(1e300),
                                                     std::bit_cast<std::uint64_t>(std::nan("")),
                                                     std::uint64_t{1} << 53U,
                                                     ~std::uint64_t{0}};
        ArchiveWriter out;
        out.word(values[random() % values.size()]);
        bad.bytes.replace(word, 8, out.bytes());
      }
      Simulation into(scene);
      const std::uint64_t before = into.state_hash();
      try {
        into.restore(bad);
      } catch (const Error&) {
        EXPECT_EQ(into.state_hash(), before);
        ++refused;
        EXPECT_NO_THROW(into.step());
        continue;
      }
      ++taken;
      try {
        steps(into, 3);
      } catch (const Error& error) {
        EXPECT_TRUE(error.fault()) << error.what();
      }
    }
  }
  EXPECT_GT(refused, 50);
  EXPECT_GT(taken, 50);
}

}  // namespace
}  // namespace handsim::simulation
