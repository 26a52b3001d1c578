// What all studies measure with and say of where they were measured.
#pragma once

#include <string>
#include <vector>

namespace handsim::study {

/// CPU time of this thread [s].
double cpu_now();
/// The middle value, the upper one of two. At least one value.
double median(std::vector<double> values);

/// The processor's name.
std::string processor();
/// Name and release of the operating system.
std::string operating_system();

}  // namespace handsim::study
