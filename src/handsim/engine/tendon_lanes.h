// Tendons of muscles and bands in lanes, and the arithmetic of a step with them: kTendonLanes tendons to a
// block, every quantity an array of lanes. Plain data, the same for every instruction set. Lanes of a block
// add to lanes of the same sums, so that tendons of neighbouring fingers lie side by side (tendon_layout.h).
#pragma once

#include <vector>

#include "handsim/model/muscle.h"

namespace handsim::engine {

inline constexpr int kTendonLanes = 4;
using TendonLane = double[kTendonLanes];

/// One coordinate a lane: what the tendons that cross it need of it and add to it.
struct alignas(32) CoordinateRow {
  TendonLane q, u;    ///< [rad], [rad/s]
  TendonLane torque;  ///< out [N m]
  TendonLane own;     ///< out: the diagonal entry of B [N m s]
  int dof[kTendonLanes];
};

/// An arm of each tendon of a block (model::MomentArm).
struct alignas(32) ArmRow {
  TendonLane c[model::kArmTerms], integral[model::kArmTerms];
  TendonLane low, high;
  TendonLane within, arm, bend;  ///< of the step: angle within the range, arm [m], its derivative [m/rad]
  int terms;                     ///< of the longest polynomial
  int coordinate;
};

/// model::ArmProduct of each tendon of a block; `a` and `b` among its arms.
struct alignas(32) ProductRow {
  TendonLane factor;
  int a, b, power_a, power_b;
};

/// Sums of an entry of B, of two coordinates.
struct alignas(32) PairRow {
  TendonLane sum;
};

/// Elastic tendons of a block of muscles (model/elastic_lanes.h).
struct alignas(32) ElasticRow {
  TendonLane per_stretch;
  // From step to step.
  TendonLane fibre;  ///< length of the fibres at the start [m]
  // Set in each step: the fibres' reach at its end at the rate of the start [m]; derivative by the rate [s].
  TendonLane reach, share;
};

/// Cross-bridges of a block of muscles (model/hill_lanes.h).
struct alignas(32) BridgeRow {
  TendonLane softness;
  // From step to step.
  TendonLane stretch;  ///< at the start [optimal lengths]
  // Set in each step: rate of the normalised fibres over that of muscle and tendon [1/m], where it is rigid.
  TendonLane per;
};

struct alignas(32) TendonBlock {
  // Constants: muscles.
  TendonLane strength, length, per_length, height, reach, least, max_speed, drag;  ///< model::HillConstants
  TendonLane up, down;  ///< times of activation [s]
  TendonLane excitable;
  TendonLane stiffness, damping, rest;  // Bands.
  TendonLane one_way;                   ///< 1: pulls only
  // From step to step.
  TendonLane activation;
  // Set in each step: tension [N] and its slope over the rate [N s/m], rate [m/s] and excursion [m].
  TendonLane force, slope, rate, excursion;
  int tendon[kTendonLanes];  ///< of the model: muscle or band; kNoTendon
  bool muscles;
  int elastic;  ///< in TendonArrays::elastic, or kRigid
  int bridges;  ///< in TendonArrays::bridges, or kRigid
  int arms, first_arm;
  int products, first_product;
  /// First of its pairs of arms (1, 0), (2, 0), (2, 1), ... in TendonArrays::pair: a PairRow, or kBounded.
  int first_pair;
};
inline constexpr int kNoTendon = -1, kBounded = -1, kRigid = -1;

struct TendonArrays {
  int blocks = 0, coordinates = 0, pairs = 0;
  TendonBlock* block = nullptr;
  CoordinateRow* coordinate = nullptr;
  ArmRow* arm = nullptr;
  const ProductRow* product = nullptr;
  const int* pair = nullptr;  ///< of each pair of arms of a block
  PairRow* sum = nullptr;
  ElasticRow* elastic = nullptr;
  BridgeRow* bridges = nullptr;
};

/// Coordinates, rates and excitations at the start of a step.
struct TendonInput {
  const double *q, *u;        ///< coordinates and rates of the model [rad], [rad/s]
  const double* excitations;  ///< by muscle; null: none
  double step;                ///< [s]
  bool goes_on;               ///< the rows have the step before, whose fibres end at these rates
};

/// The tendon kernel of one instruction set. All kernels compute the same bits.
struct TendonKernel {
  const char* name;
  /// Activations at the end of a step, arms at its start, tensions at the rates of its start and the lengths
  /// to which these lead, torques and B.
  void (*pull)(const TendonArrays&, const TendonInput&);
};

}  // namespace handsim::engine
