// Variable-order BDF on the stabilised index-2 form: the reference formulation.
//
// Gear, Gupta & Leimkuhler (1985, J Comput Appl Math 12:77) keep positions and velocities on the constraints
// with a second set of multipliers mu:
//   x' = T(x) (u + M^-1 G^T mu),  u' = M^-1 (f - G^T lambda),  g = 0,  G u + g_t = 0,
// where mu = 0 in the exact solution. lambda and mu enter as rates of impulses, lambda = Lambda' and
// mu = Mu' (Gear 1988, SIAM J Sci Stat Comput 9:39). That reduces the index to 1, and the step size scales
// the columns of the multipliers in the Newton matrix like those of the motion.
#include <algorithm>
#include <cmath>
#include <memory>
#include <new>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "handsim/engine/checks.h"
#include "handsim/engine/dae/gear.h"
#include "handsim/engine/multibody/projection.h"

namespace handsim::engine {
namespace dae {

namespace {

/// Frees what SUNDIALS made.
struct Free {
  void operator()(SUNContext context) const { SUNContext_Free(&context); }
  void operator()(N_Vector vector) const { N_VDestroy(vector); }
  void operator()(SUNMatrix matrix) const { SUNMatDestroy(matrix); }
  void operator()(SUNLinearSolver solver) const { SUNLinSolFree(solver); }
  void operator()(void* ida) const { IDAFree(&ida); }
};
template <class T>
using Owner = std::unique_ptr<std::remove_pointer_t<T>, Free>;

/// SUNDIALS IDA: variable-order, variable-step BDF for F(t, y, y') = 0 (Hindmarsh et al. 2005, ACM TOMS 31).
struct Ida {
  Owner<SUNContext> context;
  Owner<N_Vector> y, slope;
  Owner<SUNMatrix> matrix;
  Owner<SUNLinearSolver> solver;
  std::unique_ptr<void, Free> memory;
};

Eigen::Map<Vector> mapped(N_Vector vector) {
  return {N_VGetArrayPointer(vector), static_cast<Index>(N_VGetLength(vector))};
}

Owner<N_Vector> made(const Vector& values, SUNContext context) {
  Owner<N_Vector> out(N_VNew_Serial(values.size(), context));
  if (!out) throw std::bad_alloc();
  mapped(out.get()) = values;
  return out;
}

constexpr long kMaxSteps = 1'000'000;
/// Convergence coefficient of Newton's method; below IDA's default of 0.33, so that its error is negligible.
constexpr double kNewtonShare = 0.05;
/// Increment of an unknown for its column of the Jacobian. The residual is a polynomial of degree two or
/// three in each, so the error of central differences is this squared, and rounding errors are below 1e-9.
constexpr double kIncrement = 1e-6;
/// Errors of single steps add up over a run: the error test of each step uses this share of the tolerance.
constexpr double kStepShare = 0.005;
/// The error tests ignore multipliers; IDA still needs some scale for their impulses [N s].
constexpr double kMultiplierTolerance = 1e3;
/// The constraint rows are chosen again when their independence is below this share of its initial value.
constexpr double kRechooseRows = 0.05;

class Gear final : public Integrator {
 public:
  Gear(System system, const Settings& settings)
      : system_(std::move(system)), tolerance_(settings.dae().tolerance), step_(settings.step) {}

  void reset(model::State& state) override {
    project_positions(system_, state);
    project_velocities(system_, state);
    ida_.reset();
  }

  /// The integrator keeps its history from step to step. It restarts when torques change, at keyframes of
  /// drives, and when the chosen constraint rows become nearly dependent.
  void advance(std::span<const double> torques, double end, model::State& state) override {
    if (!std::equal(torques.begin(), torques.end(), torques_.begin(), torques_.end())) {
      torques_.assign(torques.begin(), torques.end());
      ida_.reset();
    }
    model::State now = state;
    if (!ida_) restart(now);
    for (; limit_ <= end; restart(now)) read(solution(limit_), limit_, now);
    if (now.time < end) {
      if (ends_++ == 0) first_end_ = end;
      read(solution(end), end, now);
    }
    system_.copy_bodies(now, state);
    if (independence(system_, now, rows_) < kRechooseRows * weakest_) ida_.reset();
  }

  /// The history of the integrator follows from its last restart and the ends of the steps since then.
  void save(ArchiveWriter& out) const override {
    out(torques_, ida_.has_value());
    if (!ida_) return;
    out(ends_, first_end_);
    serialize(out, origin_);
  }

  /// Integrates again from the last restart.
  void restore(const model::State& state, ArchiveReader& in) override {
    in(torques_);
    if (!torques_.empty() && torques_.size() != static_cast<std::size_t>(system_.model().dof_count()))
      in.refuse(fmt::format("{} torques", torques_.size()), "one for each coordinate");
    bool runs = false;
    in(runs);
    ida_.reset();
    if (!runs) return;
    long ends = 0;
    double end = 0;
    in(ends, end);
    model::State origin = state;
    serialize(in, origin);
    require_state(system_.model(), origin);
    const double past = end + static_cast<double>(ends - 1) * step_;
    const bool fits = ends == 0 ? origin.time == state.time
                                : origin.time < end && end <= origin.time + 1.5 * step_ &&
                                      std::abs(past - state.time) <= 0.5 * step_;
    if (!(origin.time >= 0 && fits))
      in.refuse("an integration history that does not end at the state", "a history that ends there");
    restart(origin);
    first_end_ = end;
    for (; ends_ < ends; ++ends_, end = next_time(end, step_)) solution(end);
  }

 private:
  void restart(const model::State& state) {
    origin_ = scratch_ = state;
    ends_ = 0;
    system_.place_driven(state.time, model::KeySide::after, scratch_);
    // If a drive starts with a velocity, the joints have it at once.
    project_velocities(system_, scratch_);
    rows_ = independent_rows(system_, scratch_, weakest_);
    const Accelerations start = accelerations(system_, scratch_, torques_, rows_);
    const Vector x = system_.positions(scratch_), u = system_.velocities(scratch_);
    const Index m = static_cast<Index>(rows_.size()), motion = x.size() + u.size();
    Vector y = Vector::Zero(motion + 2 * m), slope = Vector::Zero(motion + 2 * m);
    y << x, u, Vector::Zero(2 * m);
    slope << system_.position_rates(x, u), start.acceleration, start.multipliers, Vector::Zero(m);
    // 1 for unknowns in the error test, 0 for the others.
    Vector absolute = Vector::Constant(y.size(), kStepShare * tolerance_), tested = Vector::Ones(y.size());
    absolute.tail(2 * m).setConstant(kMultiplierTolerance);
    tested.tail(2 * m).setZero();
    limit_ = system_.next_key(state.time);
    start_ida(state.time, y, slope, absolute, tested);
  }

  /// @param y and slope consistent
  void start_ida(double time, const Vector& y, const Vector& slope, const Vector& absolute,
                 const Vector& tested) {
    ida_.emplace();
    SUNContext context = nullptr;
    SUNContext_Create(nullptr, &context);
    ida_->context.reset(context);
    ida_->y = made(y, context);
    ida_->slope = made(slope, context);
    const Owner<N_Vector> absolutes = made(absolute, context), ids = made(tested, context);
    ida_->matrix.reset(SUNDenseMatrix(y.size(), y.size(), context));
    ida_->solver.reset(SUNLinSol_Dense(ida_->y.get(), ida_->matrix.get(), context));
    ida_->memory.reset(IDACreate(context));
    if (!ida_->matrix || !ida_->solver || !ida_->memory) throw std::bad_alloc();
    void* ida = ida_->memory.get();
    IDASetErrHandlerFn(ida, on_message, this);
    IDASetUserData(ida, this);
    IDAInit(ida, on_residual, time, ida_->y.get(), ida_->slope.get());
    IDASVtolerances(ida, kStepShare * tolerance_, absolutes.get());
    IDASetId(ida, ids.get());
    IDASetSuppressAlg(ida, SUNTRUE);
    IDASetMaxNumSteps(ida, kMaxSteps);
    IDASetNonlinConvCoef(ida, kNewtonShare);
    IDASetLinearSolver(ida, ida_->solver.get(), ida_->matrix.get());
    IDASetJacFn(ida, on_jacobian);
  }

  /// At times [s] that do not decrease; internal steps may pass them, not `limit_`. @throws Error (physics)
  Vector solution(double time) {
    void* ida = ida_->memory.get();
    if (std::isfinite(limit_)) IDASetStopTime(ida, limit_);
    double reached = 0;
    if (IDASolve(ida, time, &reached, ida_->y.get(), ida_->slope.get(), IDA_NORMAL) >= 0)
      return mapped(ida_->y.get());
    IDAGetCurrentTime(ida, &reached);
    fail(reached, worst_unknown());
  }

  /// Index of the unknown with the largest weighted error.
  Index worst_unknown() const {
    const Owner<N_Vector> errors(N_VClone(ida_->y.get())), weights(N_VClone(ida_->y.get()));
    Index worst = 0;
    if (IDAGetEstLocalErrors(ida_->memory.get(), errors.get()) != IDA_SUCCESS ||
        IDAGetErrWeights(ida_->memory.get(), weights.get()) != IDA_SUCCESS)
      return worst;
    const Vector weighted = mapped(errors.get()).cwiseProduct(mapped(weights.get())).cwiseAbs();
    if (weighted.allFinite()) weighted.maxCoeff(&worst);
    return worst;
  }

  static int on_residual(double t, N_Vector y, N_Vector slope, N_Vector out, void* user) {
    Vector residual(mapped(out).size());
    static_cast<Gear*>(user)->residual(t, mapped(y), mapped(slope), residual);
    mapped(out) = residual;
    // 1 asks IDA to repeat with a smaller step.
    return residual.allFinite() ? 0 : 1;
  }

  static int on_jacobian(double t, double cj, N_Vector y, N_Vector slope, N_Vector, SUNMatrix out, void* user,
                         N_Vector, N_Vector, N_Vector) {
    Gear& self = *static_cast<Gear*>(user);
    Vector at = mapped(y), moving = mapped(slope);
    Vector ahead(at.size()), behind(at.size());
    for (Index i = 0; i < at.size(); ++i) {
      const double value = at[i], rate = moving[i];
      const double change = kIncrement * std::max(1.0, std::abs(value));
      at[i] = value + change, moving[i] = rate + cj * change;
      self.residual(t, at, moving, ahead);
      at[i] = value - change, moving[i] = rate - cj * change;
      self.residual(t, at, moving, behind);
      at[i] = value, moving[i] = rate;
      Eigen::Map<Vector>(SUNDenseMatrix_Column(out, i), at.size()) = (ahead - behind) / (2 * change);
    }
    return 0;
  }

  static void on_message(int, const char*, const char*, char* text, void* user) {
    static_cast<Gear*>(user)->message_ = text;
  }

  void read(const Vector& y, double time, model::State& state) const {
    const Index positions = kPoseSize * system_.body_count();
    state.time = time;
    system_.place_driven(time, model::KeySide::before, state);
    system_.set_positions(y.head(positions), state);
    system_.set_velocities(y.segment(positions, kTwistSize * system_.body_count()), state);
    // IDA's interpolated solution satisfies the constraints only to the tolerance.
    project_positions(system_, state);
    project_velocities(system_, state);
  }

  const ConstraintRow& scratch_row(Index i) const { return scratch_rows_[as_index(rows_[as_index(i)])]; }

  /// G^T multipliers.
  Vector joint_force(const Vector& multipliers) const {
    Vector out = Vector::Zero(kTwistSize * system_.body_count());
    for (Index i = 0; i < multipliers.size(); ++i)
      system_.add_transposed(scratch_row(i), multipliers[i], scratch_, out);
    return out;
  }

  void residual(double t, const Vector& y, const Vector& slope, Vector& out) {
    const Index nx = kPoseSize * system_.body_count(), nu = kTwistSize * system_.body_count();
    const Index m = static_cast<Index>(rows_.size());
    const Vector x = y.head(nx), u = y.segment(nx, nu);
    system_.place_driven(t, t >= limit_ ? model::KeySide::before : model::KeySide::after, scratch_);
    system_.set_positions(x, scratch_);
    system_.set_velocities(u, scratch_);
    system_.constraints(scratch_, scratch_rows_);
    const Vector correction = system_.over_mass(joint_force(slope.tail(m)));
    out.head(nx) = slope.head(nx) - system_.position_rates(x, u + correction);
    out.segment(nx, nu) = slope.segment(nx, nu) - system_.over_mass(system_.all_forces(scratch_, torques_) -
                                                                    joint_force(slope.segment(nx + nu, m)));
    for (Index i = 0; i < m; ++i) {
      const ConstraintRow& row = scratch_row(i);
      out[nx + nu + i] = row.value;
      out[nx + nu + m + i] = rate(row, scratch_);
    }
  }

  [[noreturn]] void fail(double time, Index worst) const {
    const Index nx = kPoseSize * system_.body_count(), nu = kTwistSize * system_.body_count();
    const Index m = static_cast<Index>(rows_.size());
    std::string where, quantity;
    if (worst < nx + nu) {
      const bool position = worst < nx;
      const Index size = position ? kPoseSize : kTwistSize;
      const Index within = position ? worst : worst - nx;
      where = system_.body_name(within / size);
      const bool linear = within % size < 3;
      quantity = position ? (linear ? "position [m]" : "rotation")
                          : (linear ? "velocity [m/s]" : "angular velocity [rad/s]");
    } else {
      where = system_.joint_of_row(rows_[as_index((worst - nx - nu) % m)]).name;
      quantity = "joint force [N or N m]";
    }
    throw Error(PhysicsFault{time, where, quantity,
                             fmt::format("IDA cannot continue at tolerance {:g} ({}): the motion diverges or "
                                         "is not smooth, or the tolerance is too small",
                                         tolerance_, message_)});
  }

  System system_;
  double tolerance_;
  std::vector<double> torques_;
  std::vector<Index> rows_;  ///< chosen independent constraint rows
  double weakest_ = 1;       ///< their independence when they were chosen
  double limit_ = 0;         ///< next keyframe [s]
  double step_;              ///< of the engine [s]
  model::State origin_;      ///< state of the last restart
  double first_end_ = 0;     ///< end of the first step since then [s]
  long ends_ = 0;            ///< number of steps since then
  std::optional<Ida> ida_;
  std::string message_;   ///< IDA's last
  model::State scratch_;  ///< work space of the residual
  std::vector<ConstraintRow> scratch_rows_;
};

}  // namespace

std::unique_ptr<Integrator> make_gear(System system, const Settings& settings) {
  return std::make_unique<Gear>(std::move(system), settings);
}

std::string gear_library() {
  char text[32] = {};
  SUNDIALSGetVersion(text, sizeof text);
  return fmt::format("SUNDIALS {}", text);
}

}  // namespace dae

std::optional<Problem> missing_library(const Settings&) { return std::nullopt; }

}  // namespace handsim::engine
