// Commands that are other programs. Oracle: what a program in the place of Python gets.
#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>
#include <string_view>

#include "app/program.h"

namespace handsim {
namespace {

using test::contains;
using test::Outcome;
using test::run_program;
using test::TemporaryFolder;
using test::write;
using Words = std::vector<std::string>;
namespace fs = std::filesystem;

/// A variable of the environment, until the end of the scope.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    if (const char* before = std::getenv(name)) before_ = before;
    ::setenv(name, value.c_str(), 1);
  }
  ~Variable() { before_ ? ::setenv(name_, before_->c_str(), 1) : ::unsetenv(name_); }

 private:
  const char* name_;
  std::optional<std::string> before_;
};

/// An interpreter that prints its arguments behind those of the start, and ends with status 7.
fs::path printing(const TemporaryFolder& folder) {
  const fs::path python =
      write(folder.path() / "python3", "#!/bin/sh\nshift 6\nprintf '%s|' \"$@\"\nexit 7\n");
  fs::permissions(python, fs::perms::owner_all);
  return python;
}

TEST(PythonCommands, GetTheirArgumentsAsTheyAre) {
  const TemporaryFolder folder;
  const Variable python("HANDSIM_PYTHON", printing(folder));
  const std::vector<std::pair<Words, bool>> cases = {
      {{"live", "a scene.yaml", "--port", "5"}, true},
      {{"compare", "--help"}, true},
      {{"identify", "a.csv", "--free", "gravity"}, true},
      {{"optimise", "a.yaml", "--help"}, true},
      {{"export", "a.yaml", "--out", "b.glb"}, true},
      {{"export", "no.yaml", "--out", "a.xml"}, true},
      {{"report", "a folder", "--out", "b.html"}, true},
      {{"run", "no.yaml", "--report"}, true},
      {{"run", "no.yaml"}, false},
  };
  for (const auto& [words, python_command] : cases) {
    const Outcome outcome = run_program(words);
    std::string line;
    for (const std::string& word : words) line += word + "|";
    EXPECT_EQ(outcome.status, python_command ? 7 : 2) << line << outcome.err;
    EXPECT_EQ(outcome.out, python_command ? line : "");
  }
}

TEST(PythonCommands, WithoutPythonEndInASentence) {
  const Variable python("HANDSIM_PYTHON", "/no/python:/no/other");
  const TemporaryFolder folder;
  const std::string out = folder.path() / "out";
  for (const Words& words :
       {Words{"live", "two_hands"}, Words{"run", "two_hands", "--report", "--out", out}}) {
    const Outcome outcome = run_program(words);
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.err,
                         "python3: got no program that starts: /no/python (No such file or directory), "
                         "/no/other (No such file or directory), need Python 3"))
        << outcome.err;
  }
  EXPECT_FALSE(fs::exists(out));  // nothing was simulated
}

// The next one runs where the first is missing. Oracle: what it prints.
TEST(PythonCommands, RunByTheNextInterpreterWhereTheFirstIsMissing) {
  const TemporaryFolder folder;
  const Variable python("HANDSIM_PYTHON", "/no/python:" + printing(folder).string());
  const Outcome outcome = run_program({"compare", "a"});
  EXPECT_EQ(outcome.status, 7);
  EXPECT_EQ(outcome.out, "compare|a|");
}

// A python3 that stands first in the path may have no NumPy. Oracle: the status of one that does nothing
// else.
TEST(PythonCommands, AreNotRunByWhateverStandsFirstInThePath) {
  if (std::string_view(HANDSIM_PYTHON_PROGRAM).empty()) GTEST_SKIP() << "built without the Python package";
  const TemporaryFolder folder;
  printing(folder);
  const Variable path("PATH", folder.path().string() + ":" + std::getenv("PATH"));
  const Outcome outcome = run_program({"compare", "--help"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "handsim compare A")) << outcome.out;
}

}  // namespace
}  // namespace handsim
