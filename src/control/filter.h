// A low-pass filter of recorded motion without delay.
#pragma once

#include <vector>

namespace handsim::control {

/// Butterworth low-pass of second order, run forwards and backwards: order four, no phase shift. At the
/// cut-off the amplitude is 1/sqrt(2) after both passes. Both ends are extended by their point reflection, so
/// that the first and last values have little influence of the start of the filter.
/// @param values samples of one quantity at equal intervals. @param step between them [s].
/// @param cutoff [Hz], below half the sampling rate.
void low_pass(std::vector<double>& values, double step, double cutoff);

/// Filters a table of `width` quantities, sample after sample; samples that are not at equal intervals are
/// first replaced by as many of a spline that are. @returns false, and changes nothing, if the cut-off is not
/// below half the rate.
bool low_pass_rows(std::vector<double>& times, std::vector<double>& values, std::size_t width, double cutoff);

}  // namespace handsim::control
