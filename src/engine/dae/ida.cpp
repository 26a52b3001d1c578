#include "handsim/engine/dae/ida.h"

#include <cmath>
#include <new>

#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

namespace handsim::engine::dae {

namespace {

constexpr long kMaxSteps = 1'000'000;
/// Convergence coefficient of Newton's method; below IDA's default of 0.33, so that its error is negligible.
constexpr double kNewtonShare = 0.05;
/// Increment of an unknown for its column of the Jacobian. The residual is a polynomial of degree two or
/// three in each, so the error of central differences is this squared, and rounding errors are below 1e-9.
constexpr double kIncrement = 1e-6;

Eigen::Map<Vector> mapped(N_Vector vector) {
  return {N_VGetArrayPointer(vector), static_cast<Index>(N_VGetLength(vector))};
}

}  // namespace

void Ida::Free::operator()(SUNContext context) const { SUNContext_Free(&context); }
void Ida::Free::operator()(N_Vector vector) const { N_VDestroy(vector); }
void Ida::Free::operator()(SUNMatrix matrix) const { SUNMatDestroy(matrix); }
void Ida::Free::operator()(SUNLinearSolver solver) const { SUNLinSolFree(solver); }
void Ida::Free::operator()(void* ida) const { IDAFree(&ida); }

Ida::Owner<N_Vector> Ida::vector(const Vector& values) const {
  Owner<N_Vector> out(N_VNew_Serial(values.size(), context_.get()));
  if (!out) throw std::bad_alloc();
  mapped(out.get()) = values;
  return out;
}

Ida::Ida(IdaProblem problem, double time, const Vector& y, const Vector& slope)
    : problem_(std::move(problem)) {
  SUNContext context = nullptr;
  SUNContext_Create(nullptr, &context);
  context_.reset(context);
  y_ = vector(y);
  slope_ = vector(slope);
  const Owner<N_Vector> absolute = vector(problem_.absolute), differential = vector(problem_.differential);
  matrix_.reset(SUNDenseMatrix(y.size(), y.size(), context));
  solver_.reset(SUNLinSol_Dense(y_.get(), matrix_.get(), context));
  ida_.reset(IDACreate(context));
  if (!matrix_ || !solver_ || !ida_) throw std::bad_alloc();
  void* ida = ida_.get();
  IDASetErrHandlerFn(ida, on_message, this);
  IDASetUserData(ida, this);
  IDAInit(ida, on_residual, time, y_.get(), slope_.get());
  IDASVtolerances(ida, problem_.relative, absolute.get());
  IDASetId(ida, differential.get());
  IDASetSuppressAlg(ida, SUNTRUE);
  IDASetMaxNumSteps(ida, kMaxSteps);
  IDASetNonlinConvCoef(ida, kNewtonShare);
  IDASetLinearSolver(ida, solver_.get(), matrix_.get());
  IDASetJacFn(ida, on_jacobian);
}

Vector Ida::advance(double time, double limit) {
  if (std::isfinite(limit)) IDASetStopTime(ida_.get(), limit);
  double reached = 0;
  const int flag = IDASolve(ida_.get(), time, &reached, y_.get(), slope_.get(), IDA_NORMAL);
  if (flag < 0) {
    IDAGetCurrentTime(ida_.get(), &reached);
    throw IdaFailure{reached, worst_unknown(), message_};
  }
  return mapped(y_.get());
}

Index Ida::worst_unknown() const {
  const Owner<N_Vector> errors(N_VClone(y_.get())), weights(N_VClone(y_.get()));
  Index worst = 0;
  if (IDAGetEstLocalErrors(ida_.get(), errors.get()) != IDA_SUCCESS ||
      IDAGetErrWeights(ida_.get(), weights.get()) != IDA_SUCCESS)
    return worst;
  const Vector weighted = mapped(errors.get()).cwiseProduct(mapped(weights.get())).cwiseAbs();
  if (weighted.allFinite()) weighted.maxCoeff(&worst);
  return worst;
}

int Ida::on_residual(double t, N_Vector y, N_Vector slope, N_Vector out, void* user) {
  Vector residual(mapped(out).size());
  static_cast<const Ida*>(user)->problem_.residual(t, mapped(y), mapped(slope), residual);
  mapped(out) = residual;
  // 1 asks IDA to repeat with a smaller step.
  return residual.allFinite() ? 0 : 1;
}

int Ida::on_jacobian(double t, double cj, N_Vector y, N_Vector slope, N_Vector, SUNMatrix out, void* user,
                     N_Vector, N_Vector, N_Vector) {
  const IdaProblem::Residual& residual = static_cast<const Ida*>(user)->problem_.residual;
  Vector at = mapped(y), moving = mapped(slope);
  Vector ahead(at.size()), behind(at.size());
  for (Index i = 0; i < at.size(); ++i) {
    const double value = at[i], rate = moving[i];
    const double change = kIncrement * std::max(1.0, std::abs(value));
    at[i] = value + change, moving[i] = rate + cj * change;
    residual(t, at, moving, ahead);
    at[i] = value - change, moving[i] = rate - cj * change;
    residual(t, at, moving, behind);
    at[i] = value, moving[i] = rate;
    Eigen::Map<Vector>(SUNDenseMatrix_Column(out, i), at.size()) = (ahead - behind) / (2 * change);
  }
  return 0;
}

void Ida::on_message(int, const char*, const char*, char* text, void* user) {
  static_cast<Ida*>(user)->message_ = text;
}

}  // namespace handsim::engine::dae
