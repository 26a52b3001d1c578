#include "handsim/output/gnuplot.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

namespace handsim::output {

int gnuplot(std::vector<std::string> arguments, const std::filesystem::path& folder) {
  arguments.insert(arguments.begin(), "gnuplot");
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", 1 /* O_WRONLY */, 0);
  pid_t child = 0;
  const int failure = posix_spawnp(&child, "gnuplot", &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0) return -1;
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status)) return -1;
  return WEXITSTATUS(status);
}

bool plot(const std::string& script, const std::filesystem::path& folder,
          const std::vector<std::string>& outputs) {
  const auto part = [&](const std::string& name) { return folder / ("." + name + ".part"); };
  bool good = gnuplot({"-e", "parts=1", script}, folder) == 0;
  std::error_code failure;
  for (const std::string& name : outputs) {
    if (good) std::filesystem::rename(part(name), folder / name, failure);
    good = good && !failure;
    if (!good) std::filesystem::remove(part(name), failure);
  }
  return good;
}

std::string plot_text(std::string text) {
  for (char& c : text)
    if (c == '\'' || c == '"' || c == '\\' || static_cast<unsigned char>(c) < ' ') c = ' ';
  return text;
}

}  // namespace handsim::output
