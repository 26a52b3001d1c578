// Work in a process of its own, for what may end the process that does it: Mesa and LLVM do not survive a
// lack of memory.
#pragma once

#include <functional>
#include <optional>
#include <string>

namespace handsim::output {

using Progress = std::function<void(double)>;

/// Runs the job in a copy of this process and waits for it. The copy holds no open file of this one's but the
/// standard streams, and ends with it. Not for a process that has made OpenGL contexts or runs other threads.
/// @param job gets a function that passes the share done, 0..1, on to `progress` (may be empty).
/// @return why it failed: what it threw, or what ended it; nothing where it went well.
std::optional<std::string> run_in_child(const std::function<void(const Progress&)>& job,
                                        const Progress& progress);

}  // namespace handsim::output
