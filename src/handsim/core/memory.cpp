#include "handsim/core/memory.h"

#include <algorithm>
#include <fstream>
#include <string>

#include <sys/resource.h>
#include <unistd.h>

namespace handsim {

namespace {

/// The first number of a file.
std::optional<std::size_t> number_in(const std::string& file) {
  std::ifstream in(file);
  std::size_t value = 0;
  return in >> value ? std::optional(value) : std::nullopt;
}

std::size_t remaining(std::size_t limit, std::size_t used) { return limit > used ? limit - used : 0; }

std::optional<std::size_t> free_in_address_space() {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return std::nullopt;
  const auto pages = number_in("/proc/self/statm");
  if (!pages) return std::nullopt;
  return remaining(limit.rlim_cur, *pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)));
}

/// Free memory of the process's control group (version 2).
std::optional<std::size_t> free_in_group() {
  std::ifstream in("/proc/self/cgroup");
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with("0::")) continue;
    const std::string folder = "/sys/fs/cgroup" + line.substr(3);
    const auto most = number_in(folder + "/memory.max"), used = number_in(folder + "/memory.current");
    if (most && used) return remaining(*most, *used);
  }
  return std::nullopt;
}

std::optional<std::size_t> free_in_machine() {
  std::ifstream in("/proc/meminfo");
  std::string key, unit;
  for (std::size_t value = 0; in >> key >> value && std::getline(in, unit);)
    if (key == "MemAvailable:") return 1024 * value;
  return std::nullopt;
}

}  // namespace

std::optional<std::size_t> free_memory() {
  std::optional<std::size_t> least;
  for (const auto& left : {free_in_address_space(), free_in_group(), free_in_machine()})
    if (left) least = least ? std::min(*least, *left) : *left;
  return least;
}

}  // namespace handsim
