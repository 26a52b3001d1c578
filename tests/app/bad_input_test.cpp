// Bad files of every kind. Oracle: the messages that each file of tests/data/bad/ states in its own first
// lines, `# expect: line:column: key: got X, need Y` (the start of the line after the file's name, or a part
// of it for other files), and the README's exit statuses.
#include <sys/stat.h>

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "app/program.h"

namespace handsim {
namespace {

using test::contains;
using test::empty_or_missing;
using test::Outcome;
using test::run_program;
using test::source;
using test::TemporaryFolder;
using test::write;
using Words = std::vector<std::string>;
namespace fs = std::filesystem;

std::vector<fs::path> bad_files() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(source("tests/data/bad")))
    if (entry.path().extension() == ".yaml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// The expectations that a bad file states.
struct Expectation {
  std::string kind = "run";
  Words expects;
};

Expectation expectation_of(const fs::path& file) {
  Expectation out;
  std::istringstream lines(test::text_of(file));
  const std::string expect = "# expect: ", kind = "# kind: ";
  for (std::string line; std::getline(lines, line) && line.starts_with("#");) {
    if (line.starts_with(expect)) out.expects.push_back(line.substr(expect.size()));
    if (line.starts_with(kind)) out.kind = line.substr(kind.size());
  }
  return out;
}

/// True if the line is the expected one: of this file from the place on, or of another file by name. ` ... `
/// matches any text.
bool matches(const std::string& line, const std::string& expect, const fs::path& file) {
  const bool of_this_file = std::isdigit(static_cast<unsigned char>(expect.front())) != 0;
  const std::string whole = of_this_file ? file.string() + ":" + expect : expect;
  const std::string gap = " ... ";
  const std::size_t cut = whole.find(gap);
  const std::string head = whole.substr(0, cut);
  if (of_this_file ? !line.starts_with(head) : !contains(line, head)) return false;
  return cut == std::string::npos || contains(line, whole.substr(cut + gap.size()));
}

class BadFile : public testing::TestWithParam<fs::path> {};

TEST_P(BadFile, IsRefusedWithEveryProblemAndNothingWritten) {
  const fs::path& file = GetParam();
  const Expectation expected = expectation_of(file);
  ASSERT_FALSE(expected.expects.empty()) << "the file states no message";
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Outcome outcome = expected.kind == "check"
                              ? run_program({"check", file.string()})
                              : run_program({expected.kind, file.string(), "--out", out.string()});
  EXPECT_EQ(outcome.status, 2) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_TRUE(empty_or_missing(out));
  Words lines = outcome.problems();
  for (const std::string& expect : expected.expects) {
    EXPECT_TRUE(contains(expect, "got ") && contains(expect, ", need")) << expect;
    const auto found = std::find_if(lines.begin(), lines.end(),
                                    [&](const std::string& line) { return matches(line, expect, file); });
    if (found == lines.end())
      ADD_FAILURE() << "missing: " << expect << "\nin: " << outcome.err;
    else
      lines.erase(found);
  }
  for (const std::string& line : lines) ADD_FAILURE() << "not expected: " << line;
}

INSTANTIATE_TEST_SUITE_P(All, BadFile, testing::ValuesIn(bad_files()),
                         [](const auto& test) { return test.param.stem().string(); });

/// Expects one problem with this part, for files that are too large or too special for the repository.
void expect_refused(const fs::path& file, const std::string& part) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Outcome outcome = run_program({"run", file.string(), "--out", out.string()});
  EXPECT_EQ(outcome.status, 2) << outcome.err;
  const Words lines = outcome.problems();
  ASSERT_EQ(lines.size(), 1U) << outcome.err.substr(0, 2000);
  EXPECT_TRUE(lines[0].starts_with(file.string() + ":")) << lines[0];
  EXPECT_TRUE(contains(lines[0], part)) << lines[0];
  EXPECT_LT(lines[0].size(), file.string().size() + 1000);
  EXPECT_TRUE(empty_or_missing(out));
}

// A ball of more triangles than a mesh may have.
TEST(BadInput, MeshesOfTooManyFacesAreRefused) {
  const TemporaryFolder folder;
  constexpr int kRings = 230;
  std::string obj;
  for (int i = 0; i <= kRings; ++i)
    for (int k = 0; k < kRings; ++k) {
      const double a = M_PI * i / kRings, b = 2 * M_PI * k / kRings;
      obj += "v " + std::to_string(std::sin(a) * std::cos(b)) + " " +
             std::to_string(std::sin(a) * std::sin(b)) + " " + std::to_string(std::cos(a)) + "\n";
    }
  for (int i = 0; i < kRings; ++i)
    for (int k = 0; k < kRings; ++k) {
      const auto at = [&](int ring, int step) {
        return std::to_string(1 + ring * kRings + (k + step) % kRings);
      };
      obj += "f " + at(i, 0) + " " + at(i + 1, 0) + " " + at(i + 1, 1) + "\nf " + at(i, 0) + " " +
             at(i + 1, 1) + " " + at(i, 1) + "\n";
    }
  write(folder.path() / "ball.obj", obj);
  const fs::path scene =
      write(folder.path() / "scene.yaml",
            "objects: [{name: ball, shape: convex_mesh, mesh: ball.obj, mass: 1, position: "
            "[0, 0, 0]}]\nduration: 1\n");
  const fs::path out = folder.path() / "out";
  const Outcome outcome = run_program({"run", scene.string(), "--out", out.string()});
  EXPECT_EQ(outcome.status, 2);
  // Triangle 100001 is in the line after the points and 100000 triangles.
  const std::string place = (folder.path() / "ball.obj").string() + ":" +
                            std::to_string((kRings + 1) * kRings + 100'001) + ":1: objects.0.mesh: ";
  EXPECT_TRUE(contains(outcome.err, place + "got more than 100000 triangles")) << outcome.err;
  EXPECT_TRUE(empty_or_missing(out));
}

TEST(BadInput, MissingAndSpecialFilesAreNamed) {
  const TemporaryFolder folder;
  expect_refused(folder.path() / "none.yaml", "got no such file, need a readable YAML file");
  expect_refused(folder.path(), "got a directory, need a readable YAML file");
  expect_refused("/dev/zero", "got a pipe, socket or device, need a readable YAML file");
  expect_refused(folder.path() / std::string(5000, 'x'), "got no such file");
  const fs::path pipe = folder.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expect_refused(pipe, "got a pipe, socket or device, need a readable YAML file");
}

TEST(BadInput, NestingAndSizeAreBounded) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "deep.yaml";
  constexpr std::size_t kTooMuch = 40'000'000, kBelowTheLimit = 4'000'000;
  expect_refused(write(file, std::string(kTooMuch, '[')), "got a file of 40000000 bytes, need at most 32 MB");
  for (const char* unit : {"[", "{", "- ", "{a: ", "? ", "[{"}) {
    std::string text;
    while (text.size() < kBelowTheLimit) text += unit;
    SCOPED_TRACE(unit);
    expect_refused(write(file, text), "got more than 64 levels of nesting, need at most 64 levels");
  }
}

TEST(BadInput, AliasesCannotGrowWithoutBound) {
  const TemporaryFolder folder;
  std::string bomb = "a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n";
  for (int i = 1; i < 12; ++i) {
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [";
    for (int k = 0; k < 10; ++k) bomb += (k > 0 ? ", *a" : "*a") + std::to_string(i - 1);
    bomb += "]\n";
  }
  expect_refused(write(folder.path() / "bomb.yaml", bomb), "got values that take more than 256 MB");
  std::string nested;
  for (int i = 0; i < 60; ++i) nested += "&n" + std::to_string(i) + " [";
  for (int i = 0; i < 100'000; ++i) nested += "1,";
  expect_refused(write(folder.path() / "nested.yaml", nested + std::string(60, ']')),
                 "got values that take more than 256 MB");
}

TEST(BadInput, HugeMapsAndWordsAreReadInTime) {
  const TemporaryFolder folder;
  std::string keys = "duration: 1\nhands: [";
  for (int i = 0; i < 60'000; ++i) keys += "x,";
  expect_refused(write(folder.path() / "hands.yaml", keys + "]\n"),
                 "got a list of 60000, need at most 60 hands");
  expect_refused(write(folder.path() / "word.yaml",
                       std::string(test::kBallScene) + "? " + std::string(3'000'000, 'k') + "\n: 1\n"),
                 "got an unknown key");
  std::string twins = "hands: []\n";
  for (int i = 0; i < 60'000; ++i) twins += "k" + std::to_string(i) + ": 1\n";
  expect_refused(write(folder.path() / "twins.yaml", twins + "hands: []\n"), "got a second \"hands\"");
}

TEST(BadInput, ProblemsOfSharedFilesAreReportedOnce) {
  const TemporaryFolder folder;
  write(folder.path() / "p.yaml", "stature: tall\nmass: 70\nsex: male\n");
  const std::string hand =
      "  - {model: " + source("handmodels/anatomical.yaml").string() + ", person: p.yaml, side: right}\n";
  const fs::path scene = write(folder.path() / "s.yaml", "hands:\n" + hand + hand + "duration: 1\n");
  const Outcome outcome = run_program({"run", scene.string(), "--out", (folder.path() / "out").string()});
  EXPECT_EQ(outcome.status, 2);
  ASSERT_EQ(outcome.problems().size(), 1U) << outcome.err;
  EXPECT_TRUE(outcome.problems()[0].starts_with((folder.path() / "p.yaml").string() +
                                                ":1:10: hands.0.person.stature: got tall, need"));
}

}  // namespace
}  // namespace handsim
