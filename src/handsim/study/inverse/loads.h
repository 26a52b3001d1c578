// Forces from outside on the bodies of a model over time, from a table.
#pragma once

#include <filesystem>
#include <map>
#include <vector>

#include "handsim/model/newton_euler.h"

namespace handsim::study {

class Loads {
 public:
  /// CSV with one row for each force and time:
  /// `time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]`, a force in world axes at a point in the
  /// world; between times of a body the force is interpolated. Or the contacts.csv of a run, whose contacts
  /// act on bodies `a` and, reversed, `b`; a contact that is missing in the next row has ended.
  /// @throws Error (input) for another header, unknown bodies or shapes, and invalid numbers.
  Loads(const std::filesystem::path& path, const model::Model& model);

  /// True for a contacts.csv: in a simulation of the scene the contacts act by themselves.
  bool are_contacts() const { return contacts_; }
  /// Force and moment at the centre of mass of each body, which is at the given places.
  void at(double time, std::span<const model::BodyMotion> bodies, std::vector<model::Wrench>& out) const;

 private:
  /// Force and moment on one body by time [s], about the world's origin.
  using Course = std::map<double, model::Wrench>;
  void end_contacts();

  bool contacts_ = false;
  std::vector<Course> courses_;  ///< by body
  std::vector<double> times_;    ///< of all rows, each once
};

}  // namespace handsim::study
