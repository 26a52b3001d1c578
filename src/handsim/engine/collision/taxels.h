// Points of touch on finger pads: the force of each contact on a pad, spread over points on the pad's surface
// as the paraboloid of pressure of the disc that is pressed flat (model::Compliance::contact_radius). Their
// sum is the contact's normal force, and where the disc has three points or more that are not on a line,
// their centre of pressure is the contact's place in its tangent plane; a smaller disc loads the nearest
// point alone.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "handsim/engine/collision/pair_table.h"
#include "handsim/engine/engine.h"

namespace handsim::engine {

class Taxels {
 public:
  /// The taxels of the last segment of a finger: on the palmar half of its capsule and of its end.
  struct Pad {
    std::string name;  ///< of the fingertip, `right.index_tip`
    int body = 0, shape = 0;
    std::size_t first = 0, count = 0;  ///< among all
  };

  /// The model must outlive this. @param spacing about that of the points along and around the pads [m]
  Taxels(const model::Model& model, double spacing);

  std::span<const Pad> pads() const { return pads_; }
  /// Of all taxels, in the frames of their bodies [m].
  std::span<const Vec3> points() const { return points_; }
  /// The part of the pad's surface that each taxel stands for [m2].
  std::span<const double> areas() const { return areas_; }
  /// Normal forces on the taxels by an engine's contacts at a state [N].
  std::vector<double> read(std::span<const Contact> contacts, const model::State& state) const;

 private:
  void add_pad(const model::HandIndex& hand, const model::Fingertip& tip, int shape, double spacing);
  void spread(const Pad& pad, const Contact& contact, const model::State& state,
              std::span<double> forces) const;

  const model::Model& model_;
  PairTable rules_;
  std::vector<Pad> pads_;
  std::vector<Vec3> points_;
  std::vector<double> areas_;
};

}  // namespace handsim::engine
