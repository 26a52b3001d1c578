// The folder --out: what it may be, and its content after the command: the complete files of one run, and
// foreign files. Oracle: the README, and the bytes of an undisturbed run.
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <chrono>

#include "app/short_run.h"
#include "handsim/output/report/page.h"
#include "handsim/simulation/simulation.h"
#include "support/written.h"

namespace handsim::test {
namespace {

TEST(OneFolder, IsForOneRunAtATime) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out", link = folder.path() / "link";
  const pid_t first = start(run_into(out, {"--set", "duration=200"}), folder.path(), [] {});
  ASSERT_TRUE(wait_for_lock(first));
  fs::create_directory_symlink(out, link);
  for (const fs::path& name : {out, link, folder.path() / "." / "out"}) {
    const Outcome second = run_program(run_into(name));
    EXPECT_EQ(second.status, 2);
    EXPECT_TRUE(second.err.starts_with("--out: got " + name.string() + ", in use by another handsim"))
        << second.err;
  }
  // The kernel removes the lock with the process.
  kill(first, SIGKILL);
  EXPECT_EQ(wait_for(first), -SIGKILL);
  EXPECT_EQ(run_program(run_into(out)).status, 0);
  expect_whole(out);
}

TEST(OneFolder, OfTenRunsAtOnceHoldsOneWholeRun) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  std::vector<pid_t> children;
  for (int i = 0; i < 10; ++i) {
    fs::create_directory(folder.path() / std::to_string(i));
    children.push_back(start(run_into(out), folder.path() / std::to_string(i), [] {}));
  }
  int good = 0;
  for (const pid_t child : children) {
    const int status = wait_for(child);
    EXPECT_TRUE(status == 0 || status == 2) << status;
    good += status == 0 ? 1 : 0;
  }
  EXPECT_GE(good, 1);
  expect_whole(out);
  for (const auto& entry : fs::directory_iterator(out))
    EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry.path();
}

TEST(EarlierRun, IsRemovedFromItsFolderAndForeignFilesStay) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  const std::string scene = source("config/dropped_hand.yaml");
  const Words rich = {"run",           scene,
                      "--out",         out.string(),
                      "--frames",      "4",
                      "--snapshot-at", "0.01",
                      "--set",         "duration=0.02",
                      "--set",         "pictures.size=[64, 48]",
                      "--set",         "record.contacts=true",
                      "--quiet"};
  EXPECT_EQ(run_program(rich).status, 0);
  EXPECT_TRUE(fs::exists(out / "frame_003.png") && fs::exists(out / "snapshot.bin") &&
              fs::exists(out / "contacts.csv"));
  const Words foreign = {"notes.txt",         "frame_final.png", "frame_1.png",
                         "frame_000.png.bak", "my_summary.json", ".hidden"};
  for (const std::string& name : foreign) write(out / name, "mine");
  write(out / ".handsim.1.abc.part", "left by a killed run");
  EXPECT_EQ(run_program(run_into(out, {"--frames", "2", "--set", "pictures.size=[64, 48]"})).status, 0);
  expect_whole(out);
  Words names, due = {"contact_sheet.png", "frame_000.png",  "frame_001.png", "resolved.yaml",
                      "summary.json",      "trajectory.csv", "trajectory.mot"};
  due.insert(due.end(), foreign.begin(), foreign.end());
  for (const auto& entry : fs::directory_iterator(out)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  std::sort(due.begin(), due.end());
  EXPECT_EQ(names, due);
  // Bad input starts no run: all files stay.
  EXPECT_EQ(run_program(run_into(out, {"--set", "solver.stepp=1"})).status, 2);
  EXPECT_EQ(run_program(run_into(out, {"--snapshot-at", "5"})).status, 2);
  EXPECT_EQ(static_cast<std::size_t>(std::distance(fs::directory_iterator(out), fs::directory_iterator())),
            due.size());
}

// Three boxes on the ground: more contacts than the estimate of a run's size foresees, which would refuse it.
TEST(EarlierRun, LeavesNoSummaryBesideTheTablesOfARunThatFails) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out", scene = folder.path() / "feet.yaml";
  std::ofstream(scene) << "objects: [{name: feet, mass: 1, position: [0, 0, 0.05], parts: ["
                          "{shape: box, edges: [0.1, 0.1, 0.1], position: [0, 0, 0]}, "
                          "{shape: box, edges: [0.1, 0.1, 0.1], position: [0.3, 0, 0]}, "
                          "{shape: box, edges: [0.1, 0.1, 0.1], position: [0, 0.3, 0]}]}]\n"
                          "ground: {}\nrecord: {contacts: true}\nduration: 1\n";
  const auto words = [&](const char* every) {
    return Words{"run", scene.string(), "--out", out.string(), "--set", std::string("record.every=") + every};
  };
  const auto size = [&](const char* name) { return static_cast<rlim_t>(fs::file_size(out / name)); };
  ASSERT_EQ(run_program(words("2e-3")).status, 0);
  const rlim_t table = size("contacts.csv");
  ASSERT_EQ(run_program(words("1")).status, 0);
  const rlim_t summary = size("summary.json");
  ASSERT_GT(summary * 9 / 10, std::max(size("contacts.csv"), size("resolved.yaml")));
  struct Disk {
    const char *every, *file;
    rlim_t most;
  };
  // A disk with space for the summary but not the table, and the reverse. Summaries differ by some digits of
  // wall-clock times.
  for (const auto& [every, file, most] :
       {Disk{"2e-3", "contacts.csv", table / 2}, Disk{"1", "summary.json", summary * 9 / 10}}) {
    ASSERT_EQ(run_program(words("1")).status, 0);
    EXPECT_EQ(status_with(words(every), folder.path(),
                          [bytes = most] {
                            const rlimit limit{bytes, bytes};
                            setrlimit(RLIMIT_FSIZE, &limit);
                          }),
              1);
    EXPECT_FALSE(fs::exists(out / "summary.json")) << every;
    const std::string said = text_of(folder.path() / "stderr");
    EXPECT_TRUE(contains(said, (out / file).string())) << said;
    EXPECT_TRUE(contains(said, "File too large")) << said;
  }
}

TEST(InputFiles, AreNeverReplaced) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  ASSERT_EQ(run_program(run_into(out, {"--snapshot-at", "0.05"})).status, 0);
  const std::string resolved = text_of(out / "resolved.yaml"), snapshot = text_of(out / "snapshot.bin");
  fs::create_directory(folder.path() / "d");
  const fs::path xml = write(folder.path() / "d/scene.xml", kBallScene),
                 png = write(folder.path() / "d/scene.png", kBallScene);
  fs::create_symlink("scene.xml", folder.path() / "d/link.xml");
  fs::create_hard_link(png, folder.path() / "d/hard.png");
  const std::vector<Words> all = {{"run", out / "resolved.yaml", "--out", out},
                                  run_into(out, {"--from-snapshot", out / "snapshot.bin"}),
                                  {"export", xml, "--out", xml},
                                  {"export", xml, "--out", folder.path() / "d/../d/scene.xml"},
                                  {"export", xml, "--out", folder.path() / "d/link.xml"},
                                  {"render", png, "--out", png},
                                  {"render", png, "--out", folder.path() / "d/hard.png"}};
  for (const Words& words : all) {
    if (words[0] == "export" && !test::has_package()) continue;
    const Outcome outcome = run_program(words);
    EXPECT_EQ(outcome.status, 2) << words[0];
    EXPECT_TRUE(outcome.err.starts_with("--out: got ") && contains(outcome.err, "input")) << outcome.err;
  }
  EXPECT_EQ(text_of(out / "resolved.yaml"), resolved);
  EXPECT_EQ(text_of(out / "snapshot.bin"), snapshot);
  EXPECT_EQ(text_of(xml), kBallScene);
  EXPECT_EQ(text_of(png), kBallScene);
}

// A command replaces a file of the kind that it writes, and no other.
TEST(FilesOfTheUser, AreNotReplaced) {
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "out";
  ASSERT_EQ(run_program(run_into(out, {})).status, 0);
  const std::string text = "a text of the user\n";
  const std::vector<std::pair<const char*, Words>> all = {
      {"x.html", {"report", out}},    {"x.png", {"render", kScene}},  {"x.xml", {"export", kScene}},
      {"x.urdf", {"export", kScene}}, {"x.osim", {"export", kScene}}, {"LICENSE", {"export", kScene}}};
  for (const auto& [name, words] : all) {
    // The package writes pages.
    const bool pages = output::has_three() && !std::string_view(HANDSIM_PYTHON_PROGRAM).empty();
    if (words[0] == "report" && !pages) continue;
    if (words[0] == "export" && !test::has_package()) continue;
    const fs::path file = write(folder.path() / name, text);
    Words complete = words;
    complete.insert(complete.end(), {"--out", file.string()});
    const Outcome refused = run_program(complete);
    EXPECT_EQ(refused.status, 2) << name;
    EXPECT_TRUE(contains(refused.err, file.string() + ", which exists and is not a")) << refused.err;
    EXPECT_EQ(text_of(file), text) << name;
    // An empty file has nothing to lose; then the command's own file is there.
    std::ofstream(file, std::ios::trunc);
    EXPECT_EQ(run_program(complete).status, 0) << name;
    EXPECT_NE(text_of(file), "") << name;
    EXPECT_EQ(run_program(complete).status, 0) << name;
  }
  if (std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) return;
  for (const fs::path& file : {out / "summary.json", out / "trajectory.csv", folder.path() / "new.txt"}) {
    const Outcome refused = run_program({"report", out, "--out", file});
    EXPECT_EQ(refused.status, 2) << file;
    EXPECT_TRUE(contains(refused.err, "need a name that ends in .html")) << refused.err;
  }
  fs::create_symlink("trajectory.csv", out / "report.html");
  const std::string table = text_of(out / "trajectory.csv");
  EXPECT_EQ(run_program({"report", out}).status, 2);
  EXPECT_EQ(text_of(out / "trajectory.csv"), table);
}

/// Creates something that is not a regular file.
void make_special_file(const fs::path& at, const std::string& kind) {
  if (kind == "a folder") fs::create_directory(at);
  if (kind == "a pipe") mkfifo(at.c_str(), 0600);
  if (kind == "a device") fs::create_symlink("/dev/null", at);
  if (kind == "a broken link") fs::create_symlink("nothing", at);
  if (kind != "a socket") return;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(at.string().size(), sizeof address.sun_path);
  at.string().copy(address.sun_path, sizeof address.sun_path - 1);
  const int socket_file = socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(socket_file, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  close(socket_file);
}

TEST(SpecialFiles, UnderTheNamesOfOutputsAreRefusedBeforeTheRunAndStay) {
  for (const std::string kind : {"a folder", "a pipe", "a device", "a socket", "a broken link"}) {
    const TemporaryFolder folder;
    for (const char* name : {"x.png", "x.xml", "x.urdf"}) {
      if (name[2] != 'p' && !test::has_package()) continue;
      const fs::path at = folder.path() / name;
      make_special_file(at, kind);
      const fs::file_type type = fs::symlink_status(at).type();
      const Outcome outcome = run_program({name[2] == 'p' ? "render" : "export", kScene, "--out", at});
      EXPECT_EQ(outcome.status, 2);
      EXPECT_TRUE(contains(outcome.err, at.string() + ": got " + kind)) << outcome.err;
      EXPECT_EQ(fs::symlink_status(at).type(), type) << kind;
    }
    for (const char* name :
         {"trajectory.csv", "summary.json", "frame_000.png", "contact_sheet.png", "plots/right_angles.png"}) {
      const fs::path out = folder.path() / "out";
      fs::create_directories((out / name).parent_path());
      make_special_file(out / name, kind);
      const Outcome outcome = run_program(run_into(out, {"--set", "duration=100"}));
      EXPECT_EQ(outcome.status, 2) << kind << name;
      EXPECT_TRUE(contains(outcome.err, (out / name).string() + ": got a ")) << outcome.err;
      EXPECT_EQ(std::distance(fs::directory_iterator(out), fs::directory_iterator()), 1);
      fs::remove_all(out);
    }
  }
  const TemporaryFolder folder;
  write(folder.path() / "plots", "mine");
  EXPECT_EQ(run_program(run_into(folder.path())).status, 2);
  EXPECT_EQ(text_of(folder.path() / "plots"), "mine");
}

TEST(LongNames, AreRefusedBeforeTheRun) {
  const TemporaryFolder folder;
  for (const auto& [command, ending] : {std::pair("render", ".png"), std::pair("export", ".xml")}) {
    if (std::string_view(command) == "export" && !test::has_package()) continue;
    const fs::path at = folder.path() / (std::string(300, 'x') + ending);
    const Outcome outcome = run_program({command, kScene, "--out", at});
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.err, "got a file that cannot be created (File name too long)"))
        << outcome.err;
  }
  fs::create_symlink("loop.png", folder.path() / "loop.png");
  EXPECT_EQ(run_program({"render", kScene, "--out", folder.path() / "loop.png"}).status, 2);
}

// Oracle: `handsim export` of the scene that has this person's hand, but for the place of the palm.
TEST(Export, WritesAPersonsHandsWithoutAScene) {
  if (!test::has_package()) GTEST_SKIP() << "built without the Python package";
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "hand.osim";
  const Words person = {"--stature", "1.75", "--mass", "72", "--sex", "male"};
  const auto exported = [&](const Words& more) {
    Words words = {"export", "--out", out};
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_EQ(run_program(words).status, 0);
    return text_of(out);
  };
  const auto count = [](const std::string& text, const std::string& part) {
    std::size_t found = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
    return found;
  };
  Words right = person;
  right.insert(right.end(), {"--side", "right"});
  const std::string one = exported(right);
  EXPECT_EQ(count(one, "<Body name="), 16u);
  EXPECT_EQ(count(one, "<Coordinate name="), 20u);
  EXPECT_EQ(count(one, "<SpringGeneralizedForce"), 20u);
  EXPECT_EQ(count(exported(person), "<Body name="), 32u);
  Words moving = right;
  moving.insert(moving.end(), {"--mount", "universal"});
  EXPECT_EQ(count(exported(moving), "<Coordinate name="), 22u);
  const std::string file = source("config/persons/median_man.yaml");
  EXPECT_EQ(
      count(exported({"--person", file, "--model", source("handmodels/prototype.yaml"), "--side", "left"}),
            "<Body name=\"right"),
      0u);
}

// Oracle: the library's run until then.
TEST(Export, BeginsAtATimeOfTheRun) {
  if (!test::has_package()) GTEST_SKIP() << "built without the Python package";
  const TemporaryFolder folder;
  const fs::path out = folder.path() / "a.xml";
  const std::string file = source("config/pose_tracking.yaml");
  ASSERT_EQ(run_program({"export", file, "--time", "50 ms", "--out", out}).status, 0);
  const scene::Scene scene = scene::load_scene(file, {});
  simulation::Simulation run(scene, simulation::no_watchers);
  while (run.state().time < 0.0499) run.step();
  const output::Moment moment = output::moment_after(run.state(), run.controller());
  const std::string expected =
      test::written("mjcf", scene.model, scene.spec.solver, &*scene.control, &moment);
  EXPECT_EQ(text_of(out), expected);
  EXPECT_NE(expected, test::written("mjcf", scene.model, scene.spec.solver, &*scene.control));
}

TEST(Export, WritesTheFormatOfTheExtension) {
  if (!test::has_package()) GTEST_SKIP() << "built without the Python package";
  const TemporaryFolder folder;
  struct Case {
    const char* name;
    Words more;
    const char* holds;  ///< null: refused
  };
  const std::vector<Case> cases = {{"a.urdf", {}, "<robot"},
                                   {"a.xml", {}, "<mujoco"},
                                   {"a.XML", {}, "<mujoco"},
                                   {"a", {}, "<mujoco"},
                                   {"b", {"--format", "urdf"}, "<robot"},
                                   {"b.urdf", {"--format", "urdf"}, "<robot"},
                                   {"a.mjcf", {}, "<mujoco"},
                                   {"a.osim", {}, "<OpenSimDocument"},
                                   {"c", {"--format", "osim"}, "<OpenSimDocument"},
                                   {"c.osim", {"--format", "urdf"}, nullptr},
                                   {"c.xml", {"--format", "osim"}, nullptr},
                                   {"c.usd", {}, nullptr},
                                   {"c.urdf", {"--format", "mjcf"}, nullptr},
                                   {"c.xml", {"--format", "urdf"}, nullptr},
                                   {"c.sdf", {}, nullptr},
                                   {"c.v2", {"--format", "mjcf"}, nullptr}};
  for (const Case& each : cases) {
    const fs::path out = folder.path() / each.name;
    Words words = {"export", kScene, "--out", out};
    words.insert(words.end(), each.more.begin(), each.more.end());
    const Outcome outcome = run_program(words);
    EXPECT_EQ(outcome.status, each.holds ? 0 : 2) << each.name << outcome.err;
    EXPECT_EQ(fs::exists(out), each.holds != nullptr) << each.name;
    if (each.holds) {
      EXPECT_TRUE(contains(text_of(out), each.holds)) << each.name;
    } else {
      EXPECT_TRUE(contains(outcome.err, "--out: got " + out.string() + ", need a name that ends in ."))
          << outcome.err;
    }
  }
  for (const char* name : {"a.jpg", "a.png.txt", "a.pngx"})
    EXPECT_EQ(run_program({"render", kScene, "--out", folder.path() / name}).status, 2) << name;
}

}  // namespace
}  // namespace handsim::test
