// Child processes: other programs, and a job whose crash does not end this one (Mesa and LLVM abort without
// memory).
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace handsim::output {

using Progress = std::function<void(double)>;

/// Runs the job in a fork of this process and waits for it. The child closes all open files but the standard
/// streams, and is killed if this process ends. Not for a process that has OpenGL contexts or other threads.
/// @param job gets a function that reports the finished share, 0..1, to `progress` (may be empty).
/// @return why the job failed (its exception, signal or status); nothing if it succeeded.
std::optional<std::string> run_in_child(const std::function<void(const Progress&)>& job,
                                        const Progress& progress);

/// Starts a program that PATH finds, without a shell; its standard output goes nowhere.
/// @returns its process, or nothing.
std::optional<pid_t> start_program(std::vector<std::string> words, const std::filesystem::path& folder = ".",
                                   int input = 0, int errors = 2);
/// Waits for a program. @returns its exit status; nothing if it did not start or did not exit by itself.
std::optional<int> wait_for(std::optional<pid_t> program);

}  // namespace handsim::output
