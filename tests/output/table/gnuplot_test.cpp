#include "handsim/output/table/gnuplot.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "handsim/output/atomic_file.h"
#include "scene_files.h"

namespace handsim::output {
namespace {

namespace fs = std::filesystem;

constexpr const char *kComplete = "<svg></svg>", *kHalf = "<sv";

/// A folder with a script, and a substitute for gnuplot on the path that writes given texts and ends with a
/// given status.
class Plot : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const char* before = std::getenv("PATH")) path_ = before;
    setenv("PATH", (folder_.path() / "bin").c_str(), 1);
    make_folder(folder_.path() / "bin");
    make_folder(folder_.path() / "out");
    write_file(out() / "a.gp", "");
  }
  void TearDown() override { setenv("PATH", path_.c_str(), 1); }

  fs::path out() const { return folder_.path() / "out"; }
  /// Draws a.svg and b.svg; the substitute writes these texts.
  bool drawn(const std::string& a, const std::string& b, int status) {
    const fs::path program = folder_.path() / "bin" / "gnuplot";
    write_file(program, "#!/bin/sh\nhead=${2#part=\\'}; head=${head%\\'}\nprintf '" + a +
                            "' > \"${head}a.svg\"\nprintf '" + b + "' > \"${head}b.svg\"\nexit " +
                            std::to_string(status) + "\n");
    fs::permissions(program, fs::perms::owner_all);
    return plot("a.gp", out(), {"a.svg", "b.svg"});
  }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(out()), fs::directory_iterator()));
  }

 private:
  test::TemporaryFolder folder_;
  std::string path_;
};

TEST_F(Plot, AppearsUnderItsNameWhenAllAreComplete) {
  EXPECT_TRUE(drawn(kComplete, kComplete, 0));
  EXPECT_EQ(test::text_of(out() / "a.svg"), kComplete);
  EXPECT_EQ(test::text_of(out() / "b.svg"), kComplete);
  EXPECT_EQ(files(), 3U);
}

TEST_F(Plot, LeavesNoFilesIfGnuplotFails) {
  EXPECT_FALSE(drawn(kComplete, kComplete, 1));
  EXPECT_EQ(files(), 1U);
}

TEST_F(Plot, LeavesNoFilesIfOnePictureIsIncomplete) {
  EXPECT_FALSE(drawn(kComplete, kHalf, 0));
  EXPECT_EQ(files(), 1U);
}

TEST_F(Plot, WithoutGnuplotIsNone) {
  EXPECT_FALSE(plot("a.gp", out(), {"a.svg"}));
  EXPECT_EQ(files(), 1U);
}

// Scripts have titles between single quotes; back quotes would start a command.
TEST(PlotText, HoldsNothingThatEndsAQuotedTextOrStartsACommand) {
  EXPECT_EQ(plot_text("a'b\"c`d\\e\nf"), "a b c d e f");
}

}  // namespace
}  // namespace handsim::output
