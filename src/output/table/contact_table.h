// Contact points and forces over time as CSV, a row for each point: `time[s],a,b,x[m],...`.
#pragma once

#include <string>

#include "handsim/model/model.h"
#include "handsim/output/atomic_file.h"

namespace handsim::output {

/// One contact point; shapes a and b by index into Model::shapes, all vectors in the world.
struct ContactRow {
  int shape_a = 0;
  int shape_b = 0;
  Vec3 position = Vec3::Zero();  ///< [m]
  Vec3 normal = Vec3::Zero();    ///< unit, out of b into a
  double depth = 0;              ///< penetration [m]
  double normal_force = 0;       ///< pressing them together [N]
  Vec3 friction = Vec3::Zero();  ///< on a [N]
};

class ContactTableWriter {
 public:
  /// The model must outlive this. @throws Error (input) where the file cannot be made.
  ContactTableWriter(const std::filesystem::path& path, const model::Model& model);

  void add(double time, const ContactRow& row);
  void finish();

 private:
  const model::Model& model_;
  AtomicFile file_;
};

}  // namespace handsim::output
