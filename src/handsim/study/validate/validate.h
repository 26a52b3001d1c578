// Files of measurements, such as config/validate.yaml: the rows that people's values stand in, and the hands
// that they are of. What computes the same of a hand and puts it beside is python/handsim/_validate.py.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "handsim/hand/hand_file.h"

namespace handsim::study {

/// A file of measurements.
struct Measurements {
  /// JSON: `title`, `goal`, and `rows` with the keys of the file, numbers in SI, poses as axis to angle, and
  /// scenes as paths from the working folder. Added to each row are the `unit` that is printed and its
  /// `scale` in SI; `over_row` is the index of the row that `relative_to` names.
  std::string text;
  using Model = std::shared_ptr<const hand::HandSpec>;
  Model hand;
  std::map<std::string, Model> variants;  ///< the same, changed (hand/what_if.h)
  std::map<std::string, hand::Person> people;
};

/// @throws Error (input) with every problem
Measurements load_measurements(const std::filesystem::path& path);
/// Only for its problems.
void read_measurements(const YamlNode& root, Diagnostics& diagnostics);

}  // namespace handsim::study
