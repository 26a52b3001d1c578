// Muscles and bands of a model: tendons with a moment arm about each joint coordinate that they cross.
// Length and arms agree: one polynomial, the excursion e(q), gives length = length at zero - e(q) and moment
// arm = de/dq = -dlength/dq. No time, no activation: see muscle_curves.h and engine/muscles.h.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace handsim::model {

inline constexpr int kArmTerms = 5;  ///< Coefficients of a moment arm's polynomial.
/// Most coordinates that a tendon may cross: two of the wrist, four of a finger, and a second finger's.
inline constexpr int kMostArms = 12;

/// Moment arm about one joint coordinate: r(q) = c0 + c1 q + c2 q^2 + ... [m], q in rad, held at its end
/// values beyond [low, high]. Positive: tension drives the coordinate towards positive values.
struct MomentArm {
  int dof = 0;  ///< coordinate, in vectors of Model::dof_count()
  std::array<double, kArmTerms> c{};
  double low = -4, high = 4;  ///< range of the polynomial [rad]
};

/// A term `factor q_a^power_a q_b^power_b` [m] of the excursion, angles held within the arms' ranges: each
/// arm changes with the other's angle, and beyond its own range has no part of this.
struct ArmProduct {
  int a = 0, b = 0;  ///< in TendonPath::arms
  int power_a = 1, power_b = 1;
  double factor = 0;
};

struct TendonPath {
  std::vector<MomentArm> arms;  ///< each coordinate once
  std::vector<ArmProduct> products;
};

/// A path at given coordinates.
struct PathState {
  double excursion = 0;                  ///< [m], 0 at zero coordinates
  std::array<double, kMostArms> arm{};   ///< by TendonPath::arms [m]
  std::array<double, kMostArms> bend{};  ///< derivative of each arm by its own coordinate [m/rad]
};

/// @param q coordinates of the model [rad]
PathState path_state(const TendonPath& path, std::span<const double> q);

/// The path of a tendon at one angle of a coordinate: the arms of the other coordinates. @return its
/// excursion there [m]
double hold(TendonPath& path, int dof, double angle);

/// Strains of an elastic tendon at the largest isometric force.
inline constexpr double kLeastTendonStrain = 1e-4, kMostTendonStrain = 0.5;

/// Stiffness of cross-bridges over active force per optimal fibre length.
inline constexpr double kLeastShortRange = 0.1, kMostShortRange = 1e4;

/// What a voluntary effort cannot leave out: a muscle is at least as active as this share of another one.
struct Spill {
  int from = 0;  ///< the other muscle, in Model::muscles
  double share = 0;
};

/// A Hill-type muscle. Its fibres lie at `pennation` where they have their optimal length.
struct Muscle {
  std::string name;        ///< unique, e.g. `right.FDP2`
  std::string nerve;       ///< that excites it, e.g. `median`; empty: not stated
  bool extrinsic = false;  ///< its belly lies in the forearm: it crosses the wrist
  TendonPath path;
  double force = 0;                 ///< largest isometric force of the fibres [N]
  double fibre_length = 0;          ///< optimal [m]
  double slack_length = 0;          ///< of the tendon [m]
  double length = 0;                ///< of muscle and tendon at zero coordinates [m]
  double pennation = 0;             ///< [rad]
  double activation_time = 0.015;   ///< [s]
  double deactivation_time = 0.05;  ///< [s]
  double max_speed = 10;            ///< fastest shortening [optimal fibre lengths/s]
  double initial = 0;               ///< activation at the start, 0..1
  double excitable = 1;  ///< share of its excitation that reaches its fibres, 0..1: a blocked nerve
  /// Who chooses activations is bound by these (static optimisation, largest forces); a given excitation is
  /// not.
  std::vector<Spill> spills;
  /// The common drive of muscles of several fingers, 0..1: while these fingers press together, the least
  /// activation of each of its muscles as a share of every other one's. 0: it has none.
  double common_drive = 0;
  double effort = 1;  ///< largest activation, 0..1: a person presses with less of a finger that is numb
  /// Strain of the tendon at the largest isometric force; absent: the tendon is rigid.
  std::optional<double> tendon_strain;
  /// Short-range stiffness of the fibres, over their active force per optimal length (model/hill_lanes.h);
  /// absent: their force follows their speed at once.
  std::optional<double> short_range;
};

/// @returns whether some muscle has an elastic tendon
bool any_elastic(std::span<const Muscle> muscles);
/// @returns whether some muscle has a short-range stiffness
bool any_short_range(std::span<const Muscle> muscles);

/// A band across joints: tension = stiffness (x - rest) + damping dx/dt, x = -e(q); slack ones pull only.
struct Band {
  std::string name;  ///< unique, e.g. `right.index_dip_pip`
  TendonPath path;
  double stiffness = 0;  ///< [N/m]
  double damping = 0;    ///< [N s/m]
  double rest = 0;       ///< [m]
  bool both_ways = true;
};

}  // namespace handsim::model
