// Makes a sequence of pictures in several processes: Mesa draws with one thread at a time in a process.
#pragma once

#include <cstddef>
#include <functional>

#include "handsim/output/render/image.h"

namespace handsim::output {

/// Makes picture i of a sequence.
using MakeImage = std::function<Image(std::size_t)>;

/// Starts `processes` forks, of which fork k makes the pictures k, k + processes, ...; passes them on in
/// order. With one process, or one picture, nothing is forked. Not for a process that has OpenGL contexts or
/// other threads.
/// @param maker called once in each process, for what its pictures share, such as a Renderer.
/// @param take called in this process.
/// @throws Error (output) with what a fork failed of, and what `take` throws.
void make_in_order(std::size_t count, int processes, const std::function<MakeImage()>& maker,
                   const std::function<void(std::size_t, Image&&)>& take);

/// Processor cores that this process may use.
int core_count();

}  // namespace handsim::output
