// How a compliant surface pushes back. Its elastic force is a curve over depth: a spring, an exponential or a
// table. Where it relaxes, its force is quasi-linear viscoelastic (Fung 1993, "Biomechanics", section 7.6;
// fingertips: Pawluk and Howe 1999, J Biomech Eng 121:178): with the elastic force F of the depth,
//   P = (1 - sum of c_k) F + sum of q_k,   dq_k/dt = c_k dF/dt - q_k / t_k.
// A sudden press has all of F, and a lasting one 1 - sum of c_k of it.
// Sizes: a pad of m times the radius has F(d) = m^2 f(d / m), the same pressure at the same strain.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

namespace handsim::model {

struct Elastic {
  double force = 0;  ///< [N]
  double slope = 0;  ///< [N/m]
};

/// Elastic force over depth. Beyond its points it goes on with its slope there, to depths below 0 with its
/// first slope.
struct ForceCurve {
  enum class Kind { spring, exponential, table };
  struct Point {
    double depth = 0;  ///< [m]
    double force = 0;  ///< [N]
    double slope = 0;  ///< [N/m]
  };

  Kind kind = Kind::spring;
  double stiffness = 0;  ///< spring: [N/m]
  double force = 0;      ///< exponential: force (exp(d / rise) - 1), [N]
  /// The depth by which the slope grows e-fold; of a table where that is least [m].
  double rise = std::numeric_limits<double>::infinity();
  std::vector<Point> points;  ///< table: from (0, 0) on, ascending

  static ForceCurve spring(double stiffness);
  static ForceCurve exponential(double force, double depth);
  /// Monotone cubic pieces (Fritsch and Butland 1984). @param points without the first one, (0, 0);
  /// depths and forces above 0, ascending
  static ForceCurve table(std::vector<Point> points);

  Elastic at(double depth) const;
  /// The depth with this force.
  double depth_of(double force) const;
};

/// A part of the force that a lasting press loses.
struct Relaxation {
  double time = 0;   ///< [s], > 0
  double share = 0;  ///< of the force of a sudden press, > 0
};
inline constexpr std::size_t kMostRelaxations = 4;

/// What a surface is that is more than a spring and a damper.
struct PadLaw {
  ForceCurve curve;
  std::vector<Relaxation> relaxations;  ///< shares add up to less than 1
  double radius = 0;                    ///< of a shape that has `curve` as it stands [m]; 0: any shape has

  /// Share of the elastic force that a lasting press keeps.
  double lasting() const;
};

/// Compliant contact of two surfaces: normal force = stiffness depth + damping d(depth)/dt, never negative;
/// with a law that of the law in place of the stiffness' part. The values hold for a whole pair of shapes;
/// its contact points share them.
struct Compliance {
  double stiffness = 0;  ///< [N/m], > 0; with a law: of a spring in series with it, or 0: none
  double damping = 0;    ///< [N s/m], >= 0
  std::shared_ptr<const PadLaw> law = nullptr;
  double size = 1;                                ///< of the pad in terms of the law's
  std::shared_ptr<const PadLaw> under = nullptr;  ///< another one in series
  double under_size = 1;
  /// Radius of the round surface that is pressed flat [m]; 0: not known.
  double radius = 0;

  /// Elastic force at a depth, which two surfaces in series share.
  Elastic elastic(double depth) const;
  /// The depth with this elastic force.
  double depth_of(double force) const;
  double lasting() const { return law ? law->lasting() : 1; }
  /// Force over depth of a press that lasts, at this force: the spring that gives way as far.
  double secant(double force) const;
  /// The depth by which the slope grows e-fold at most; infinite for a spring.
  double rise() const;
  /// Radius of the disc that a depth presses flat: its paraboloid of pressure holds the force [m].
  double contact_radius(double depth) const;
};

/// Springs, dampers and laws in series. The same force, and depths add: exact for what a sudden press does.
/// Relaxation is that of the first with a law; exact where both relax alike.
Compliance in_series(const Compliance& a, const Compliance& b);

/// Two springs, or two dampers, in series; one of 0 is absent.
double in_series(double a, double b);

}  // namespace handsim::model
