// Bad input of every kind. Oracle: the messages that each file of tests/data/bad/ states in its own first
// lines, `# expect: line:column: key: got X, need Y` (the start of the line after the file's name, or a part
// of it for other files), and DESIGN's exit statuses.
#include <sys/stat.h>

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "program.h"

namespace handsim {
namespace {

using test::Outcome;
using test::run_program;
using test::source;
using test::TemporaryFolder;
using Words = std::vector<std::string>;
namespace fs = std::filesystem;

const std::string kScene = source("config/two_hands.yaml");

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

bool empty_or_missing(const fs::path& folder) { return !fs::exists(folder) || fs::is_empty(folder); }

fs::path write(const fs::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

std::vector<fs::path> bad_files() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(source("tests/data/bad")))
    if (entry.path().extension() == ".yaml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// What a bad file says of itself.
struct Promise {
  std::string kind = "run";
  Words expects;
};

Promise promise_of(const fs::path& file) {
  Promise out;
  std::istringstream lines(test::text_of(file));
  const std::string expect = "# expect: ", kind = "# kind: ";
  for (std::string line; std::getline(lines, line) && line.starts_with("#");) {
    if (line.starts_with(expect)) out.expects.push_back(line.substr(expect.size()));
    if (line.starts_with(kind)) out.kind = line.substr(kind.size());
  }
  return out;
}

/// True where the line is what is expected: of this file from the place on, or of another file by name. ` ...
/// ` stands for anything.
bool matches(const std::string& line, const std::string& expect, const fs::path& file) {
  const bool of_this_file = std::isdigit(static_cast<unsigned char>(expect.front())) != 0;
  const std::string whole = of_this_file ? file.string() + ":" + expect : expect;
  const std::string gap = " ... ";
  const std::size_t cut = whole.find(gap);
  const std::string head = whole.substr(0, cut);
  if (of_this_file ? !line.starts_with(head) : !contains(line, head)) return false;
  return cut == std::string::npos || contains(line, whole.substr(cut + gap.size()));
}

constexpr const char* kObject =
    "objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0]}]\nduration: 2\n";

class BadFile : public testing::TestWithParam<fs::path> {};

TEST_P(BadFile, IsRefusedWithEveryProblemAndNothingWritten) {
  const fs::path& file = GetParam();
  const Promise promise = promise_of(file);
  ASSERT_FALSE(promise.expects.empty()) << "the file states no message";
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Outcome outcome = promise.kind == "check"
                              ? run_program({"check", file.string()})
                              : run_program({"run", file.string(), "--out", out.string()});
  EXPECT_EQ(outcome.status, 2) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_TRUE(empty_or_missing(out));
  Words lines = outcome.problems();
  for (const std::string& expect : promise.expects) {
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

/// A file made here, for those too large or too odd to keep: one line with this part is due.
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
  expect_refused(write(folder.path() / "scene.yaml",
                       "objects: [{name: ball, shape: convex_mesh, mesh: ball.obj, mass: 1, position: [0, 0, "
                       "0]}]\nduration: 1\n"),
                 "got 105800 faces, need at most 100000 faces");
}

TEST(BadInput, MissingAndOddFilesAreNamed) {
  const TemporaryFolder folder;
  expect_refused(folder.path() / "none.yaml", "got no such file, need a readable YAML file");
  expect_refused(folder.path(), "got a directory, need a readable YAML file");
  expect_refused("/dev/zero", "got no regular file, need a readable YAML file");
  expect_refused(folder.path() / std::string(5000, 'x'), "got no such file");
  const fs::path pipe = folder.path() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expect_refused(pipe, "got no regular file, need a readable YAML file");
}

TEST(BadInput, NestingAndSizeAreBounded) {
  const TemporaryFolder folder;
  const fs::path file = folder.path() / "deep.yaml";
  constexpr std::size_t kTenMegabytes = 10'000'000, kBelowTheLimit = 4'000'000;
  expect_refused(write(file, std::string(kTenMegabytes, '[')),
                 "got a file of 10000000 bytes, need at most 4194304 bytes");
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
  expect_refused(write(folder.path() / "bomb.yaml", bomb), "got more than 200000 values");
  std::string nested;
  for (int i = 0; i < 60; ++i) nested += "&n" + std::to_string(i) + " [";
  for (int i = 0; i < 100'000; ++i) nested += "1,";
  expect_refused(write(folder.path() / "nested.yaml", nested + std::string(60, ']')),
                 "got more than 200000 values");
}

TEST(BadInput, HugeMapsAndWordsAreReadInTime) {
  const TemporaryFolder folder;
  std::string keys = "duration: 1\nhands: [";
  for (int i = 0; i < 60'000; ++i) keys += "x,";
  expect_refused(write(folder.path() / "hands.yaml", keys + "]\n"),
                 "got a list of 60000, need at most 60 hands");
  expect_refused(write(folder.path() / "word.yaml",
                       std::string(kObject) + "? " + std::string(3'000'000, 'k') + "\n: 1\n"),
                 "got an unknown key");
  std::string twins = "hands: []\n";
  for (int i = 0; i < 60'000; ++i) twins += "k" + std::to_string(i) + ": 1\n";
  expect_refused(write(folder.path() / "twins.yaml", twins + "hands: []\n"), "got a second \"hands\"");
}

TEST(BadInput, SharedFilesAreBlamedOnce) {
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

/// Arguments that must give exit status 2 and one problem with this part.
struct Usage {
  const char* name;
  Words arguments;
  std::string part;
};

void PrintTo(const Usage& usage, std::ostream* out) { *out << usage.name; }

class BadUsage : public testing::TestWithParam<Usage> {};

TEST_P(BadUsage, IsRefusedWithOneMessage) {
  const TemporaryFolder folder;
  const std::string mark = "OUT";
  Words arguments = GetParam().arguments;
  for (std::string& argument : arguments)
    if (argument.starts_with(mark))
      argument = (folder.path() / ("out" + argument.substr(mark.size()))).string();
  const Outcome outcome = run_program(arguments);
  EXPECT_EQ(outcome.status, 2) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  ASSERT_FALSE(outcome.problems().empty());
  EXPECT_TRUE(contains(outcome.problems()[0], GetParam().part)) << outcome.err;
  // CLI11 adds a line that points to --help.
  EXPECT_LE(outcome.problems().size(), 2U) << outcome.err;
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

Words run_with(const Words& rest) {
  Words arguments = {"run", kScene, "--out", "OUT"};
  arguments.insert(arguments.end(), rest.begin(), rest.end());
  return arguments;
}

Words hand_with(const Words& rest) {
  Words arguments = {"hand", "--out", "OUT"};
  arguments.insert(arguments.end(), rest.begin(), rest.end());
  return arguments;
}

const std::vector<Usage> kUsages = {
    {"NoCommand",
     {},
     "command: got nothing, need one of hand, check, run, render, accuracy, grasp, effects, export, "
     "contacts"},
    {"UnknownCommand",
     {"rum"},
     "command: got rum, need one of hand, check, run, render, accuracy, grasp, effects, export, contacts, "
     "stability "
     "(nearest: "
     "run)"},
    {"UnknownOption", run_with({"--fast"}), "--fast"},
    {"RunWithoutOut", {"run", kScene}, "--out is required"},
    {"RunWithoutScene", {"run", "--out", "OUT"}, "scene is required"},
    {"OutIsNothing", {"run", kScene, "--out", ""}, "--out: got \"\", need a path"},
    {"OutUnderProc",
     {"run", kScene, "--out", "/proc/handsim/out"},
     "/proc/handsim/out: got a folder that cannot be made"},
    {"FramesNegative", run_with({"--frames", "-1"}), "--frames: got -1, need a whole number"},
    {"FramesHalf", run_with({"--frames", "1.5"}), "--frames: got 1.5, need a whole number"},
    {"CheckOfNothing", {"check"}, "files is required"},
    {"RenderTimeNegative",
     {"render", kScene, "--out", "OUT.png", "--time", "-1"},
     "--time: got -1, need a time"},
    {"RenderTimeWord",
     {"render", kScene, "--out", "OUT.png", "--time", "noon"},
     "--time: got noon, need a time"},
    {"RenderTimeBeyond",
     {"render", kScene, "--out", "OUT.png", "--time", "1 h"},
     "--time: got 1 h, need a time"},
    {"RenderTimeAfterEnd",
     {"render", kScene, "--out", "OUT.png", "--time", "5 s"},
     "--time: got 5 s, need 0 to the scene's duration of 2 s"},
    {"RenderIntoNoFolder",
     {"render", kScene, "--out", "OUT/none/a.png"},
     ".png: got a file that cannot be created"},
    {"HandOfNobody",
     {"hand", "--out", "OUT", "--stature", "1.7", "--mass", "60"},
     "--sex: got nothing, need one of male, female, unknown"},
    {"HandSex", hand_with({"--stature", "1.7", "--mass", "60", "--sex", "femal"}),
     "--sex: got femal, need one of male, female, unknown (nearest: female)"},
    {"HandStature", hand_with({"--stature", "175", "--mass", "60", "--sex", "male"}),
     "--stature: got 175, need a length, 0.5 to 2.5 m"},
    {"HandUnit", hand_with({"--stature", "1.75", "--mass", "60 lb", "--sex", "male"}),
     "--mass: got 60 lb, need a mass"},
    {"HandStatureNothing", hand_with({"--stature", "", "--mass", "60", "--sex", "male"}),
     "--stature: got \"\", need a length"},
    {"HandCircumference",
     hand_with({"--stature", "1.7", "--mass", "60", "--sex", "male", "--hand-breadth", "0.08",
                "--hand-circumference", "0.1"}),
     "--hand-circumference: got 0.1 m around a breadth of 0.08 m"},
    {"HandSide", hand_with({"--stature", "1.7", "--mass", "60", "--sex", "male", "--side", "up"}),
     "--side: got up, need right, left or both"},
    {"HandPersonAndSex", hand_with({"--person", source("config/persons/child.yaml"), "--sex", "male"}),
     "--sex: got a value beside --person"},
    {"HandPersonIsScene", hand_with({"--person", kScene}), "got a scene, need a person"},
    {"HandModelIsPerson",
     hand_with({"--stature", "1.7", "--mass", "60", "--sex", "male", "--model",
                source("config/persons/child.yaml")}),
     "got a person, need a hand model"},
    {"HandModelMissing",
     hand_with({"--stature", "1.7", "--mass", "60", "--sex", "male", "--model", "/none.yaml"}),
     "/none.yaml:1:1: got no such file"},
    {"SetWithoutEquals", run_with({"--set", "solver.step"}),
     "--set: got \"solver.step\", need key.path=value"},
    {"SetWithoutKey", run_with({"--set", "=1"}), "--set: got \"=1\", need key.path=value"},
    {"SetEmptyPart", run_with({"--set", "solver..step=1"}),
     "--set: got \"solver..step\", need a path of keys"},
    {"SetIndexBeyond", run_with({"--set", "hands.2.side=left"}),
     "--set hands.2.side: got \"2\" for a list of 2, need an index from 0 to 1"},
    {"SetIndexWord", run_with({"--set", "hands.first.side=left"}),
     "--set hands.first.side: got \"first\" for a list of 2"},
    {"SetThroughScalar", run_with({"--set", "title.x=1"}), "--set title.x: got \"x\" within two limp hands"},
    {"SetThroughNumber", run_with({"--set", "solver.step.deep=1"}),
     "--set solver.step.deep: got \"deep\" within \"1 ms\", need a path through mappings and lists"},
    {"SetUnknownKey", run_with({"--set", "solver.stepp=1"}),
     "--set solver.stepp:1:1: solver.stepp: got an unknown key"},
    {"SetWrongValue", run_with({"--set", "solver.step=fast"}),
     "--set solver.step:1:1: solver.step: got fast, need a time"},
    {"SetNothing", run_with({"--set", "solver.step="}), "solver.step: got nothing, need a time"},
    {"SetBrokenYaml", run_with({"--set", "effects=[gravity"}), "--set effects:1:"},
    {"SetInPersonFile", run_with({"--set", "hands.0.person.mass=-5"}),
     "hands.0.person.mass: got -5, need a mass"},
};

INSTANTIATE_TEST_SUITE_P(All, BadUsage, testing::ValuesIn(kUsages),
                         [](const auto& test) { return test.param.name; });

TEST(BadInput, OverridesAreBlamedAllAtOnce) {
  const TemporaryFolder folder;
  const Outcome outcome = run_program({"run", kScene, "--out", (folder.path() / "out").string(), "--set",
                                       "title.x=1", "--set", "hands.9.side=left", "--set", "a"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_EQ(outcome.problems().size(), 3U) << outcome.err;
}

TEST(BadInput, AnOverrideTakesOneWord) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Outcome outcome = run_program(
      {"run", "--set", "duration=10 ms", kScene, "--out", out.string(), "--set", "criteria={}", "--quiet"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out / "summary.json"));
}

TEST(BadInput, AFileInTheFoldersPlaceIsLeftAlone) {
  const TemporaryFolder folder;
  const fs::path out = write(folder.path() / "out", "mine");
  for (const Words& arguments :
       {Words{"run", kScene, "--out", out.string()},
        Words{"hand", "--stature", "1.7", "--mass", "60", "--sex", "male", "--out", out.string()}}) {
    const Outcome outcome = run_program(arguments);
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_TRUE(contains(outcome.err, out.string() + ": got ")) << outcome.err;
    EXPECT_EQ(test::text_of(out), "mine");
  }
}

TEST(BadInput, CheckTellsGoodFilesFromBad) {
  const std::string person = source("config/persons/child.yaml"), model = source("handmodels/prototype.yaml");
  const std::string bad = source("tests/data/bad/person_missing_keys.yaml");
  const Outcome outcome = run_program({"check", kScene, bad, person, model, "/none.yaml"});
  EXPECT_EQ(outcome.status, 2);
  for (const std::string& good :
       {kScene + ": a scene, good", person + ": a person, good", model + ": a hand model, good"})
    EXPECT_TRUE(contains(outcome.out, good)) << outcome.out;
  EXPECT_FALSE(contains(outcome.out, bad));
  EXPECT_EQ(outcome.problems().size(), 3U) << outcome.err;
  EXPECT_EQ(run_program({"check", kScene, person, model}).status, 0);
}

TEST(BadInput, HelpIsNoErrorAndHasAnExample) {
  EXPECT_EQ(run_program({"--help"}).status, 0);
  EXPECT_EQ(run_program({"--version"}).status, 0);
  for (const char* command : {"hand", "check", "run", "render", "effects"}) {
    const Outcome outcome = run_program({command, "--help"});
    EXPECT_EQ(outcome.status, 0);
    EXPECT_TRUE(contains(outcome.out, "Example: handsim " + std::string(command))) << outcome.out;
  }
}

TEST(EffectsCommand, RefusesBadInputAsEverywhereAndWritesNothing) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Outcome typo = run_program({"effects", kScene, "--out", out.string(), "--set", "solver.stepp=1 ms"});
  EXPECT_EQ(typo.status, 2);
  EXPECT_TRUE(contains(typo.err, "solver.stepp: got")) << typo.err;
  EXPECT_TRUE(contains(typo.err, "nearest: step")) << typo.err;
  const Outcome repeats = run_program({"effects", kScene, "--out", out.string(), "--repeats", "0"});
  EXPECT_EQ(repeats.status, 2);
  EXPECT_TRUE(contains(repeats.err, "got 0, need a whole number of timed rounds")) << repeats.err;
  EXPECT_EQ(run_program({"effects", kScene}).status, 2);
  EXPECT_EQ(run_program({"effects", "/none.yaml", "--out", out.string()}).status, 2);
  const Outcome none = run_program(
      {"effects", kScene, "--out", out.string(), "--set", "effects=[]", "--set", "duration=10 ms"});
  EXPECT_EQ(none.status, 2);
  EXPECT_TRUE(contains(none.err, "effects: got no effect")) << none.err;
  EXPECT_TRUE(empty_or_missing(out));
}

TEST(EffectsCommand, PrintsATableOrJsonAndLeavesItsFiles) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const Words words = {"effects", kScene, "--out", out.string(), "--set", "duration=50 ms", "--repeats", "1"};
  const Outcome table = run_program(words);
  EXPECT_EQ(table.status, 0) << table.err;
  for (const char* effect : {"\ngravity", "\njoint_stops", "\npassive_tissue"})
    EXPECT_TRUE(contains(table.out, effect)) << table.out;
  for (const char* file : {"effects.csv", "effects.json", "effects.png", "effects.svg"})
    EXPECT_TRUE(fs::exists(out / file)) << file;
  Words json = words;
  json.push_back("--json");
  const Outcome printed = run_program(json);
  EXPECT_EQ(printed.status, 0) << printed.err;
  EXPECT_EQ(printed.out, test::text_of(out / "effects.json"));
}

// A ball in a gravity of 1000 m/s2 passes the engine's limit of 1000 m/s after 1 s.
TEST(Divergence, GivesStatusOneThePlaceAndCompleteFiles) {
  const TemporaryFolder folder;
  const fs::path scene =
      write(folder.path() / "fall.yaml",
            std::string(kObject) + "effects: [gravity]\ngravity: [0, 0, -1000]\nrecord: {every: 0.01}\n");
  const fs::path out = folder.path() / "out";
  const Outcome outcome = run_program({"run", scene.string(), "--out", out.string()});
  EXPECT_EQ(outcome.status, 1);
  ASSERT_EQ(outcome.problems().size(), 1U) << outcome.err;
  EXPECT_TRUE(outcome.problems()[0].starts_with("at t = 1.001 s: ball: speed [m/s]: 1001 is beyond 1000"))
      << outcome.err;
  const std::string trajectory = test::text_of(out / "trajectory.csv");
  EXPECT_TRUE(trajectory.ends_with('\n'));
  // A head, and rows from 0 to 1 s.
  EXPECT_EQ(std::count(trajectory.begin(), trajectory.end(), '\n'), 102);
  EXPECT_TRUE(contains(test::text_of(out / "summary.json"), "speed [m/s]"));
  EXPECT_TRUE(fs::exists(out / "resolved.yaml"));
  for (const auto& entry : fs::directory_iterator(out)) EXPECT_NE(entry.path().extension(), ".part");
}

TEST(Criteria, ThatFailGiveStatusOne) {
  const TemporaryFolder folder;
  const Outcome outcome = run_program({"run", kScene, "--out", (folder.path() / "out").string(), "--set",
                                       "duration=20 ms", "--set", "criteria.joint_gap=0"});
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "FAILED")) << outcome.out;
}

}  // namespace
}  // namespace handsim
