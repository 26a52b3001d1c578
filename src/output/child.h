// Runs a job in a child process, whose crash does not end the program: Mesa and LLVM abort without memory.
#pragma once

#include <functional>
#include <optional>
#include <string>

namespace handsim::output {

using Progress = std::function<void(double)>;

/// Runs the job in a fork of this process and waits for it. The child closes all open files but the standard
/// streams, and is killed if this process ends. Not for a process that has OpenGL contexts or other threads.
/// @param job gets a function that reports the finished share, 0..1, to `progress` (may be empty).
/// @return why the job failed (its exception, signal or status); nothing if it succeeded.
std::optional<std::string> run_in_child(const std::function<void(const Progress&)>& job,
                                        const Progress& progress);

}  // namespace handsim::output
