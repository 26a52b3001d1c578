// Measures of hard cases: what is conserved.
#include <algorithm>
#include <array>
#include <cmath>

#include "handsim/model/energy.h"
#include "handsim/study/stability/measure_tools.h"

namespace handsim::study {

namespace {

using simulation::Simulation;

double mechanical_energy(const Simulation& now) {
  return model::kinetic_energy(now.model(), now.state()) +
         model::potential_energy(now.model(), now.state(), now.engine().settings().effects);
}

/// Energy against the largest kinetic energy of the run.
class Energy final : public Measure {
 public:
  enum class What { gain, error, loss, rise };
  Energy(What what, const MeasureSpec& spec) : what_(what), spec_(spec) {}

  void look(const Simulation& now) override {
    if (!within(spec_, now.state().time)) return;
    const double energy = mechanical_energy(now);
    if (!start_) start_ = lowest_ = energy;
    lowest_ = std::min(lowest_, energy);
    scale_ = std::max(scale_, model::kinetic_energy(now.model(), now.state()));
    last_ = change(energy);
    if (what_ == What::loss) largest_ = {};
    largest_.book(last_, now.state().time);
  }
  std::optional<Figure> figure() const override {
    auto out = largest_.figure();
    if (out) out->value = scale_ > 0 ? out->value / scale_ : 0;
    return out;
  }
  std::optional<double> course() const override {
    return scale_ > 0 ? std::optional(last_ / scale_) : std::nullopt;
  }

 private:
  double change(double energy) const {
    switch (what_) {
      case What::gain:
        return energy - *start_;
      case What::error:
        return std::abs(energy - *start_);
      case What::loss:
        return *start_ - energy;
      case What::rise:
        return energy - lowest_;
    }
    return 0;
  }
  What what_;
  MeasureSpec spec_;
  std::optional<double> start_;
  double lowest_ = 0, scale_ = 0, last_ = 0;
  Largest largest_;
};

template <Energy::What what>
std::unique_ptr<Measure> make_energy(const scene::Scene&, const MeasureSpec& spec) {
  return std::make_unique<Energy>(what, spec);
}

/// Angular momentum about the common centre of mass against its start.
class Momentum final : public Measure {
 public:
  explicit Momentum(const scene::Scene& scene, const MeasureSpec& spec) : bodies_(bodies_of(scene, spec)) {}

  void look(const Simulation& now) override {
    const Vec3 value = angular_momentum(now);
    if (!start_) start_ = value;
    last_ = (value - *start_).norm() / start_->norm();
    largest_.book(last_, now.state().time);
  }
  std::optional<Figure> figure() const override { return largest_.figure(); }
  std::optional<double> course() const override { return last_; }

 private:
  Vec3 angular_momentum(const Simulation& now) const {
    double mass = 0;
    Vec3 centre = Vec3::Zero(), velocity = Vec3::Zero(), out = Vec3::Zero();
    for (const std::size_t i : bodies_) {
      mass += now.model().bodies[i].mass;
      centre += now.model().bodies[i].mass * now.state().bodies[i].p;
      velocity += now.model().bodies[i].mass * now.state().bodies[i].v;
    }
    centre /= mass, velocity /= mass;
    for (const std::size_t i : bodies_) {
      const model::Body& body = now.model().bodies[i];
      const model::BodyState& at = now.state().bodies[i];
      out += at.q * (body.inertia * (at.q.conjugate() * at.w));
      out += body.mass * (at.p - centre).cross(at.v - velocity);
    }
    return out;
  }
  std::vector<std::size_t> bodies_;
  std::optional<Vec3> start_;
  double last_ = 0;
  Largest largest_;
};

using D = Dimension;

const std::array kEnergyMeasures = {
    MeasureKind{"energy_gain",
                "largest gain of energy over the start's, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::gain>},
    MeasureKind{"energy_error",
                "largest change of energy, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::error>},
    MeasureKind{"energy_loss",
                "energy lost at the end, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::loss>},
    MeasureKind{"energy_rise",
                "largest rise of energy over its lowest so far, in largest kinetic energies",
                D::none,
                "",
                false,
                {},
                make_energy<Energy::What::rise>},
    MeasureKind{"momentum_error",
                "largest change of angular momentum, relative",
                D::none,
                "",
                false,
                {},
                make_of_scene<Momentum>}};

}  // namespace

std::span<const MeasureKind> energy_measures() { return kEnergyMeasures; }

}  // namespace handsim::study
