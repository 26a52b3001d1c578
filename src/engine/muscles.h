// Muscles and ligaments within the step of an engine. A tension at the step's end depends on the rates u+
// that the step finds: F = F(l0 + h l', l'), linear about the start. The generalised torques are
//   tau = start - B (u+ - u0),   B = sum over tendons of (h dF/dl + dF/dl') r r^T,
// with the moment arms r at the start. An engine solves them together with its motion: with B itself, or with
// a diagonal that exceeds it (row sums of |B|), which is stable at any step and exact at rest, and less exact
// in fast motion. Activations go one step by their own law before. No engine's types.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "handsim/engine/engine.h"
#include "handsim/engine/packed_arms.h"

namespace handsim::engine {

/// @throws Error (input) for excitations without the muscles effect, of another number, or not within 0..1.
void require_excitations(const model::Model& model, const Settings& settings,
                         std::span<const double> excitations);

class Muscles {
 public:
  /// Whether the engine solves an entry of B, of two coordinates; what it does not is bounded by the
  /// diagonal.
  using Solves = std::function<bool(int, int)>;
  /// The model must outlive this.
  Muscles(const model::Model& model, const Settings& settings, const Solves& solves);

  /// True where neither effect has anything to do.
  bool empty() const { return tendons_.empty(); }
  /// Takes over activations.
  void start(const model::State& state) { activation_ = state.activation; }
  /// Activations at the end of a step, tensions at its start. @param q, u by Model::dof_count()
  void begin(std::span<const double> q, std::span<const double> u, std::span<const double> excitations);
  /// `start` of the torques, by Model::dof_count() [N m].
  std::span<const double> torques() const { return torques_; }
  /// An entry of B, row >= column [N m s].
  struct Slope {
    int row = 0, column = 0;
    double value = 0;
  };
  /// What the engine solves of B, all rows by columns, the bound of the rest on its diagonal.
  std::span<const Slope> slopes() const { return slopes_; }
  /// For an engine that solves the diagonal only: torques + damping u- of each coordinate, with which
  /// `tau = out - damping u+` is the law above, and that damping, by Model::dof_count() [N m s/rad].
  void by_coordinate(std::span<const double> u, std::span<const double> given, std::vector<double>& torques,
                     std::vector<double>& damping) const;
  /// Writes activations, fibre lengths and tensions at the end of the step. @param u rates at its end
  void end(std::span<const double> q, std::span<const double> u, model::State& state) const;

 private:
  /// A muscle or a ligament.
  struct Tendon {
    const model::TendonPath* path = nullptr;
    const model::Muscle* muscle = nullptr;
    const model::Ligament* ligament = nullptr;
    std::size_t first = 0, count = 0;  ///< of its arms, in arms_
    std::vector<int> own;              ///< of slopes_, the diagonal of each arm
    std::vector<int> slots;  ///< of slopes_, pair by pair of its arms; kNoSlot: bounded on the diagonals
    // Of the step.
    double force = 0, slope = 0, rate = 0;
  };
  int slot(int a, int b);
  double rate_of(const Tendon& tendon, std::span<const double> u) const;
  void pull(Tendon& tendon, std::span<const double> u, double activation);
  double tension_at(const Tendon& tendon, std::span<const double> u) const;

  double step_;
  std::vector<Tendon> tendons_;
  PackedArms arms_;  ///< of the tendons, in their order
  std::vector<Slope> slopes_;
  std::vector<double> torques_;
  std::vector<double> activation_;
  std::size_t muscles_ = 0;  ///< tendons of muscles, which come first
};

}  // namespace handsim::engine
