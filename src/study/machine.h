// CPU time, the median, and names of processor and operating system, for all studies.
#pragma once

#include <string>
#include <vector>

namespace handsim::study {

/// CPU time of this thread [s].
double cpu_now();
/// The median of at least one value; of an even number, the upper middle value.
double median(std::vector<double> values);

/// The processor's name.
std::string processor();
/// Name and release of the operating system.
std::string operating_system();

}  // namespace handsim::study
