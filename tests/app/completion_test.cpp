// Completion scripts and the man page. Oracle: bash itself completes; the commands' own help has the words.
#include <gtest/gtest.h>

#include <cstdlib>

#include "app/program.h"

namespace handsim {
namespace {

using test::contains;
using test::run_program;
using test::text_of;

/// What bash offers for the last of some words.
std::string completed(const std::string& words, int count) {
  const test::TemporaryFolder folder;
  const auto script = test::write(folder.path() / "handsim.bash", run_program({"completion", "bash"}).out);
  const auto ask = test::write(folder.path() / "ask.bash",
                               "source '" + script.string() + "'\nCOMP_WORDS=(" + words +
                                   ")\nCOMP_CWORD=" + std::to_string(count) + "\nhandsim() { '" +
                                   test::kProgramFile + "' \"$@\"; }\n_handsim\necho \"${COMPREPLY[@]}\"\n");
  const std::string out = folder.path() / "out";
  EXPECT_EQ(std::system(("bash '" + ask.string() + "' > '" + out + "' 2>&1").c_str()), 0) << text_of(out);
  std::string text = text_of(out);
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

TEST(Completion, InBashGivesCommandsOptionsAndWords) {
  EXPECT_EQ(completed("handsim eff", 1), "effects");
  EXPECT_EQ(completed("handsim run scene.yaml --fra", 3), "--frames");
  EXPECT_EQ(completed("handsim hand --side l", 3), "left");
  EXPECT_EQ(completed("handsim export scene.yaml --mount u", 4), "universal");
  // The package's own words.
  if (!std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) {
    EXPECT_EQ(completed("handsim export scene.yaml --format ''", 4), "mjcf urdf osim glb usda obj stl mcap");
  }
  // A file of the user is left to the shell.
  EXPECT_EQ(completed("handsim run two_hands --from-snapshot ''", 4), "");
}

// Oracle: the files in config/.
TEST(Completion, OffersShippedFilesWhereACommandTakesThem) {
  EXPECT_EQ(completed("handsim run two_", 2), "two_hands two_hands_contact");
  EXPECT_EQ(completed("handsim accuracy accuracy_s", 2), "accuracy_slider_crank accuracy_stops");
  EXPECT_EQ(completed("handsim run accuracy_s", 2), "");
  EXPECT_EQ(completed("handsim hand --person median_", 3), "median_man median_woman");
  EXPECT_EQ(completed("handsim hand --model eld", 3), "elder");
  // A command of the Python package.
  EXPECT_EQ(completed("handsim live grasp_power", 2), "grasp_power_can");
  EXPECT_EQ(completed("handsim accuracy accuracy_slider_crank --ta", 3), "--target");
  EXPECT_EQ(completed("handsim report two_", 2), "");
  EXPECT_TRUE(
      contains(run_program({"completion", "fish"}).out, "__fish_seen_subcommand_from run' -a 'bench "));
}

TEST(Completion, OfEveryShellAndTheManPageNameEveryCommandAndOption) {
  const std::string help = run_program({"--help"}).out;
  for (const std::string shell : {"bash", "zsh", "fish", "man"}) {
    const auto outcome = run_program({"completion", shell});
    EXPECT_EQ(outcome.status, 0);
    for (const std::string command : {"hand", "check", "run", "render", "accuracy", "grasp", "effects",
                                      "export", "stability", "completion"}) {
      EXPECT_TRUE(contains(help, command));
      EXPECT_TRUE(contains(outcome.out, command)) << shell << ", " << command;
    }
    EXPECT_TRUE(contains(outcome.out, shell == "man" ? "\\-\\-snapshot\\-at" : "snapshot-at")) << shell;
  }
  const auto unknown = run_program({"completion", "tcsh"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_TRUE(contains(unknown.err, "got tcsh, need one of bash, zsh, fish, man")) << unknown.err;
}

}  // namespace
}  // namespace handsim
