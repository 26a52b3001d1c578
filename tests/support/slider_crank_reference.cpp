#include "support/slider_crank_reference.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include <cvode/cvode.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "handsim/core/error.h"

namespace handsim::study {

namespace {

constexpr double kTolerance = 3e-15;  // of each step; 13 times the rounding of a double
constexpr double kEnergyTolerance = 1e-10;
constexpr long kMaxSteps = 10'000'000;

// All bodies' velocities are their derivatives with respect to theta times omega, so the kinetic energy is
// J(theta) omega^2 / 2 and Lagrange's equation reads J a + J' omega^2 / 2 + V' = torque. Primes are
// d/dtheta. With the pin at (0, y, z), rho^2 = y^2 + z^2 and the slider at x = sqrt(L^2 - rho^2):
//   J = I_c + m_c (l/2)^2                                      crank, about its hinge
//     + m_r |(x', y', z')|^2 / 4 + I_t |(x', y', z')|^2 / L^2  rod: centre of mass and transverse rotation
//     + I_a s^2 + m_s x'^2                                     rod: axial rotation; slider
// The universal joint keeps a transverse axis of the rod perpendicular to x, so the axial rotation rate of
// the rod is s = (x / L) phi', where phi = atan2(z, y) is the direction of that axis about x.
struct Geometry {
  double y, y1, y2;  // pin and its derivatives
  double z, z1, z2;
  double x, x1, x2;  // slider
  double s, s1;      // axial rotation rate of the rod
};

Geometry geometry(const SliderCrankSpec& spec, double theta) {
  const double l = spec.crank_length;
  const double sine = std::sin(theta), cosine = std::cos(theta);
  Geometry g{};
  g.y = spec.axis_y - l * sine, g.y1 = -l * cosine, g.y2 = l * sine;
  g.z = spec.axis_z + l * cosine, g.z1 = -l * sine, g.z2 = -l * cosine;
  const double rho2 = g.y * g.y + g.z * g.z;
  const double half1 = g.y * g.y1 + g.z * g.z1;  // (rho^2)' / 2
  const double half2 = g.y1 * g.y1 + g.z1 * g.z1 + g.y * g.y2 + g.z * g.z2;
  g.x = std::sqrt(spec.rod_length * spec.rod_length - rho2);
  g.x1 = -half1 / g.x;
  g.x2 = -(half2 + g.x1 * g.x1) / g.x;
  const double swept = g.y * g.z1 - g.z * g.y1;
  const double swept1 = g.y * g.z2 - g.z * g.y2;
  g.s = g.x * swept / (spec.rod_length * rho2);
  g.s1 = (g.x1 * swept + g.x * swept1 - 2 * g.x * swept * half1 / rho2) / (spec.rod_length * rho2);
  return g;
}

/// Factor of |(x', y', z')|^2 in J: mass and transverse inertia of the rod.
double rod_share(const SliderCrankSpec& spec) {
  return spec.rod_mass / 4 + spec.rod_inertia / (spec.rod_length * spec.rod_length);
}

double reduced_inertia(const SliderCrankSpec& spec, const Geometry& g) {
  const double arm = spec.crank_length / 2;
  return spec.crank_inertia + spec.crank_mass * arm * arm +
         rod_share(spec) * (g.x1 * g.x1 + g.y1 * g.y1 + g.z1 * g.z1) + spec.rod_axial_inertia * g.s * g.s +
         spec.slider_mass * g.x1 * g.x1;
}

/// J' / 2.
double half_slope(const SliderCrankSpec& spec, const Geometry& g) {
  return rod_share(spec) * (g.x1 * g.x2 + g.y1 * g.y2 + g.z1 * g.z2) + spec.rod_axial_inertia * g.s * g.s1 +
         spec.slider_mass * g.x1 * g.x2;
}

/// Mass that moves with the height of the pin: half the crank and half the rod.
double lifted_mass(const SliderCrankSpec& spec) { return (spec.crank_mass + spec.rod_mass) / 2; }

/// CVODE and its objects, freed in reverse order.
class Integrator {
 public:
  explicit Integrator(const SliderCrankReference& reference, double theta, double omega)
      : reference_(reference) {
    SUNContext context = nullptr;
    SUNContext_Create(nullptr, &context);
    context_.reset(context);
    y_.reset(N_VNew_Serial(2, context));
    NV_Ith_S(y_.get(), 0) = theta;
    NV_Ith_S(y_.get(), 1) = omega;
    // Adams for a smooth problem that is not stiff; Newton, because fixed-point iteration converges too
    // slowly.
    cvode_.reset(CVodeCreate(CV_ADAMS, context));
    matrix_.reset(SUNDenseMatrix(2, 2, context));
    solver_.reset(SUNLinSol_Dense(y_.get(), matrix_.get(), context));
    void* cvode = cvode_.get();
    CVodeSetErrHandlerFn(cvode, on_message, this);
    CVodeInit(cvode, rhs, 0, y_.get());
    CVodeSStolerances(cvode, kTolerance, kTolerance);
    CVodeSetUserData(cvode, this);
    CVodeSetMaxNumSteps(cvode, kMaxSteps);
    CVodeSetNonlinConvCoef(cvode, 0.01);
    CVodeSetLinearSolver(cvode, solver_.get(), matrix_.get());
  }

  SliderCrankState advance(double time) {
    double reached = 0;
    const int flag = time > 0 ? CVode(cvode_.get(), time, y_.get(), &reached, CV_NORMAL) : CV_SUCCESS;
    if (flag < 0)
      throw Error(PhysicsFault{time, "slider-crank reference", "crank angle [rad]", "CVODE: " + message_});
    return reference_.state(time, NV_Ith_S(y_.get(), 0), NV_Ith_S(y_.get(), 1));
  }

 private:
  struct Free {
    void operator()(SUNContext context) const { SUNContext_Free(&context); }
    void operator()(N_Vector vector) const { N_VDestroy(vector); }
    void operator()(SUNMatrix matrix) const { SUNMatDestroy(matrix); }
    void operator()(SUNLinearSolver solver) const { SUNLinSolFree(solver); }
    void operator()(void* cvode) const { CVodeFree(&cvode); }
  };
  template <class T>
  using Owner = std::unique_ptr<std::remove_pointer_t<T>, Free>;

  static int rhs(realtype, N_Vector y, N_Vector ydot, void* user) {
    const double theta = NV_Ith_S(y, 0), omega = NV_Ith_S(y, 1);
    NV_Ith_S(ydot, 0) = omega;
    NV_Ith_S(ydot, 1) = static_cast<const Integrator*>(user)->reference_.acceleration(theta, omega);
    return 0;
  }

  static void on_message(int, const char*, const char*, char* text, void* user) {
    static_cast<Integrator*>(user)->message_ = text;
  }

  const SliderCrankReference& reference_;
  std::string message_;
  Owner<SUNContext> context_;
  Owner<N_Vector> y_;
  Owner<SUNMatrix> matrix_;
  Owner<SUNLinearSolver> solver_;
  std::unique_ptr<void, Free> cvode_;
};

}  // namespace

SliderCrankSpec SliderCrankSpec::iftomm() {
  SliderCrankSpec spec;
  spec.speed = 6;
  return spec;
}

SliderCrankSpec SliderCrankSpec::constant_torque() {
  SliderCrankSpec spec;
  spec.torque = 0.1;
  spec.angle = M_PI / 2;
  return spec;
}

SliderCrankReference::SliderCrankReference(const SliderCrankSpec& spec) : spec_(spec) {
  const double axis = std::hypot(spec.axis_y, spec.axis_z);
  // Written so that NaN fails.
  if (!(spec.crank_length > 0 && axis > spec.crank_length))
    throw input_error("crank_length", fmt::format("{:g} m", spec.crank_length),
                      fmt::format("above 0, below the axis' distance from the slider's line, {:g} m", axis));
  if (!(spec.rod_length > axis + spec.crank_length))
    throw input_error(
        "rod_length", fmt::format("{:g} m", spec.rod_length),
        fmt::format("above {:g} m, so that the crank can rotate fully", axis + spec.crank_length));
  for (const double inertia : {spec.crank_mass, spec.rod_mass, spec.slider_mass, spec.crank_inertia,
                               spec.rod_inertia, spec.rod_axial_inertia})
    if (!(inertia > 0 && std::isfinite(inertia)))
      throw input_error("slider-crank", fmt::format("a mass or inertia of {:g}", inertia), "above 0");
}

double SliderCrankReference::acceleration(double theta, double omega) const {
  const Geometry g = geometry(spec_, theta);
  const double load = spec_.torque - lifted_mass(spec_) * spec_.gravity * g.z1;
  return (load - half_slope(spec_, g) * omega * omega) / reduced_inertia(spec_, g);
}

SliderCrankState SliderCrankReference::state(double time, double theta, double omega) const {
  const Geometry g = geometry(spec_, theta);
  SliderCrankState out;
  out.time = time;
  out.theta = theta;
  out.omega = omega;
  out.x = g.x;
  out.vx = g.x1 * omega;
  out.energy = 0.5 * reduced_inertia(spec_, g) * omega * omega +
               lifted_mass(spec_) * spec_.gravity * (g.z - spec_.axis_z) -
               spec_.torque * (theta - spec_.angle);
  return out;
}

std::vector<SliderCrankState> SliderCrankReference::at(std::span<const double> times) const {
  Integrator integrator(*this, spec_.angle, spec_.speed);
  const double start = state(0, spec_.angle, spec_.speed).energy;
  // Scale of the energy test: the larger of kinetic energy and the potential energy of lifting the pin.
  double scale = lifted_mass(spec_) * std::abs(spec_.gravity) * spec_.crank_length;
  std::vector<SliderCrankState> out;
  for (const double time : times) {
    out.push_back(integrator.advance(time));
    const SliderCrankState& now = out.back();
    scale = std::max(scale, 0.5 * reduced_inertia(spec_, geometry(spec_, now.theta)) * now.omega * now.omega);
    if (!(std::abs(now.energy - start) <= kEnergyTolerance * scale))
      throw Error(PhysicsFault{time, "slider-crank reference", "energy [J]",
                               fmt::format("{:.12g} differs from {:.12g} at the start by more than {:g}",
                                           now.energy, start, kEnergyTolerance)});
  }
  return out;
}

std::vector<SliderCrankState> SliderCrankReference::series(double duration, double every) const {
  std::vector<double> times(static_cast<std::size_t>(std::lround(duration / every)) + 1);
  for (std::size_t i = 0; i < times.size(); ++i) times[i] = static_cast<double>(i) * every;
  return at(times);
}

}  // namespace handsim::study
