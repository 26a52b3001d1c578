// Commands that are other programs. Oracle: what a program in the place of Python gets.
#include <gtest/gtest.h>

#include <cstdlib>

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

/// The search path of programs, until the end of the scope.
class SearchPath {
 public:
  explicit SearchPath(const fs::path& folder) { ::setenv("PATH", folder.c_str(), 1); }
  ~SearchPath() { ::setenv("PATH", before_.c_str(), 1); }

 private:
  std::string before_ = std::getenv("PATH");
};

TEST(PythonCommands, GetTheirArgumentsAsTheyAre) {
  const TemporaryFolder folder;
  const fs::path python =
      write(folder.path() / "python3", "#!/bin/sh\nshift 3\nprintf '%s|' \"$@\"\nexit 7\n");
  fs::permissions(python, fs::perms::owner_all);
  const SearchPath path(folder.path());
  const std::vector<std::pair<Words, bool>> cases = {
      {{"live", "a scene.yaml", "--port", "5"}, true},    {{"compare", "--help"}, true},
      {{"identify", "a.csv", "--free", "gravity"}, true}, {{"optimise", "a.yaml", "--help"}, true},
      {{"export", "a.yaml", "--out", "b.glb"}, true},     {{"export", "a.yaml", "--format=usda"}, true},
      {{"export", "no.yaml", "--out", "glb.xml"}, false},
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
  const TemporaryFolder folder;
  const SearchPath path(folder.path());
  const Outcome outcome = run_program({"live", "two_hands"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "python3: got no program of this name, need Python 3")) << outcome.err;
}

}  // namespace
}  // namespace handsim
