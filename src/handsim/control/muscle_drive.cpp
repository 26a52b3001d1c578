#include "handsim/control/muscle_drive.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "handsim/core/text.h"
#include "handsim/model/muscle_curves.h"

namespace handsim::control {

namespace {

/// Weight of missing torque [1/(N m)^2]: a thousandth of a coordinate's largest counts as activation 1.
constexpr double kMissing = 1e6;
/// A muscle counts with at least this share of its isometric force, however fast it shortens [1]: chosen.
constexpr double kLeastShare = 0.2;
constexpr int kBlockPivots = 20;
/// Solutions with what muscles give at the last one's activations, which are counted as at least so much.
constexpr int kPasses = 4;
constexpr double kLeastActivation = 0.02;

/// The muscle that a muscle is tied to in the end, and its share of that.
struct Root {
  std::size_t muscle = 0;
  double share = 1;
  Eigen::Index at() const { return static_cast<Eigen::Index>(muscle); }
};

Root root_of(const std::vector<const model::Spill*>& tied, std::size_t muscle) {
  Root out = {muscle};
  while (const model::Spill* spill = tied[out.muscle])
    out = {as_index(spill->from), out.share * spill->share};
  return out;
}
/// Solutions of the active set of what spills, until no muscle lacks more than kSpilled of that.
constexpr int kSpillPasses = 8;
constexpr double kSpilled = 1e-4;

}  // namespace

MusclePlan table_plan(const model::Model& model, MotionTable table, Diagnostics& diagnostics) {
  MusclePlan plan;
  std::vector<std::string> known;
  for (const model::Muscle& muscle : model.muscles) {
    const std::string bare = muscle.name.substr(muscle.name.find('.') + 1);
    std::optional<std::size_t> column;
    for (const std::string& name : {bare, muscle.name}) {
      known.push_back(name);
      const auto found = std::ranges::find(table.names, name);
      if (found != table.names.end()) column = as_index(found - table.names.begin());
    }
    plan.columns.push_back(column);
  }
  const Place head{table.file, table.header_line, 1};
  for (const std::string& name : table.names)
    if (std::ranges::find(known, name) == known.end())
      diagnostics.problems.push_back(
          {head, name, "a column that is no muscle", "HAND.MUSCLE or MUSCLE" + nearest_hint(name, known)});
  for (std::size_t row = 0; row < table.times.size(); ++row)
    for (std::size_t column = 0; column < table.names.size(); ++column)
      if (const double value = table.at(row, column); !(value >= 0 && value <= 1) && !diagnostics.full())
        diagnostics.problems.push_back({Place{table.file, table.lines[row], 1}, table.names[column],
                                        fmt::format("{:g}", value), "an excitation of 0 to 1"});
  plan.table = std::make_shared<const MotionTable>(std::move(table));
  return plan;
}

StaticOptimisation::StaticOptimisation(const model::Model& model, std::vector<std::size_t> dofs, double least)
    : model_(model), least_(least), dofs_(std::move(dofs)), row_(as_index(model.dof_count())) {
  // Bone, not muscles, holds a joint that is fused.
  for (const model::Joint& joint : model.joints)
    for (std::size_t a = 0; a < joint.axes.size(); ++a)
      if (model::fused(joint.axes[a])) std::erase(dofs_, as_index(joint.first_dof) + a);
  for (std::size_t i = 0; i < dofs_.size(); ++i) row_[dofs_[i]] = static_cast<Eigen::Index>(i);
  const auto rows = static_cast<Eigen::Index>(dofs_.size());
  const auto muscles = static_cast<Eigen::Index>(model.muscles.size());
  arms_.resize(rows, muscles);
  wanted_.resize(rows);
  missing_ = Eigen::VectorXd::Zero(rows);
  activation_ = Eigen::VectorXd::Zero(muscles);
  most_.resize(muscles);
  for (std::size_t m = 0; m < model.muscles.size(); ++m)
    most_[static_cast<Eigen::Index>(m)] = std::max(least, model.muscles[m].effort);
  bound_.assign(as_index(static_cast<int>(muscles)), 0);
  out_.resize(bound_.size());
  spills_ =
      std::ranges::any_of(model.muscles, [](const model::Muscle& each) { return !each.spills.empty(); });
}

/// Ties muscles that have less than what reaches them to the muscle that it reaches them from, and frees
/// those that should have more. @returns whether any has changed
bool StaticOptimisation::tie() {
  bool changed = false;
  const Eigen::VectorXd slope = own_Q_ * activation_ - own_c_;
  for (std::size_t m = 0; m < tied_.size(); ++m) {
    const model::Spill *most = nullptr, *before = std::exchange(tied_[m], nullptr);
    for (const model::Spill& each : model_.muscles[m].spills)
      if (root_of(tied_, as_index(each.from)).muscle != m && (!most || reaches(each) > reaches(*most)))
        most = &each;
    const auto at = static_cast<Eigen::Index>(m);
    const double lacks = most ? reaches(*most) - activation_[at] : 0;
    // A tied muscle has its share, and is freed where more of it costs less.
    if (before ? slope[at] < 0 || lacks < -kSpilled : lacks < kSpilled) most = nullptr;
    changed = changed || most != before;
    tied_[m] = most;
  }
  return changed;
}

double StaticOptimisation::reaches(const model::Spill& spill) const {
  return std::min(1.0, spill.share * activation_[spill.from]);
}

/// The problem of muscles that are not tied; the others have their share.
void StaticOptimisation::reduce() {
  Q_ = own_Q_;
  c_ = own_c_;
  const auto each_tied = [&](const auto& f) {
    for (std::size_t m = 0; m < tied_.size(); ++m)
      if (tied_[m]) f(static_cast<Eigen::Index>(m), root_of(tied_, m));
  };
  each_tied([&](Eigen::Index m, const Root& root) { Q_.col(root.at()) += root.share * own_Q_.col(m); });
  const Eigen::MatrixXd by_row = Q_;
  each_tied([&](Eigen::Index m, const Root& root) {
    Q_.row(root.at()) += root.share * by_row.row(m);
    c_[root.at()] += root.share * own_c_[m];
  });
  each_tied([&](Eigen::Index m, const Root&) {
    Q_.row(m).setZero();
    Q_.col(m).setZero();
    Q_(m, m) = 1;
    c_[m] = 0;
  });
}

/// Q and c of a . Q a / 2 - c . a.
void StaticOptimisation::assemble(const model::State& state, std::span<const double> torques, bool rested,
                                  bool again) {
  arms_.setZero();
  for (std::size_t i = 0; i < dofs_.size(); ++i) wanted_[static_cast<Eigen::Index>(i)] = torques[dofs_[i]];
  for (std::size_t m = 0; m < model_.muscles.size(); ++m) {
    const model::Muscle& muscle = model_.muscles[m];
    const model::PathState path = model::path_state(muscle.path, state.q);
    double rate = 0;
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i)
      rate -= path.arm[i] * state.u[as_index(muscle.path.arms[i].dof)];
    // What an activation gives at the present speed; a muscle that shortens fast keeps a share.
    const double excursion =
        muscle.tendon_strain ? model::fibre_excursion(muscle, state.fibre_length[m]) : path.excursion;
    const double passive = model::passive_force(muscle, excursion);
    const double at_activation =
        again ? std::max(activation_[static_cast<Eigen::Index>(m)], kLeastActivation) : 1;
    const double active =
        std::max((model::tension(muscle, excursion, rate, muscle.excitable * at_activation).force - passive) /
                     at_activation,
                 kLeastShare * model::isometric_force(muscle, excursion));
    for (std::size_t i = 0; i < muscle.path.arms.size(); ++i) {
      const std::optional<Eigen::Index> row = row_[as_index(muscle.path.arms[i].dof)];
      if (!row) continue;
      arms_(*row, static_cast<Eigen::Index>(m)) = path.arm[i] * active;
      if (!rested) wanted_[*row] -= path.arm[i] * passive;
    }
  }
  // Rows by their largest torque, so that a fingertip counts as much as the wrist.
  Q_.setIdentity(arms_.cols(), arms_.cols());
  c_.setZero(arms_.cols());
  for (Eigen::Index i = 0; i < arms_.rows(); ++i) {
    const double most = arms_.row(i).cwiseAbs().sum();
    if (!(most > 0)) continue;
    const double weight = kMissing / (most * most);
    Q_.selfadjointView<Eigen::Lower>().rankUpdate(arms_.row(i).transpose(), weight);
    c_ += weight * wanted_[i] * arms_.row(i).transpose();
  }
  Q_ = Eigen::MatrixXd(Q_.selfadjointView<Eigen::Lower>());
}

/// Block principal pivoting (Judice & Pires 1994, Comput Oper Res 21:587); Q is positive definite. After some
/// passes one at a time, the last first, which cannot go round in circles (Murty 1974).
void StaticOptimisation::minimise() {
  const Eigen::Index n = Q_.rows();
  std::vector<Eigen::Index> free;
  for (int pass = 0; pass < kBlockPivots + 20 * static_cast<int>(n); ++pass) {
    free.clear();
    for (Eigen::Index i = 0; i < n; ++i) {
      const signed char bound = bound_[as_index(static_cast<int>(i))];
      activation_[i] = bound > 0 ? most_[i] : bound < 0 ? least_ : 0;
      if (bound == 0) free.push_back(i);
    }
    const Eigen::VectorXd rest = c_ - Q_ * activation_;
    if (!free.empty()) {
      const Eigen::VectorXd x = Eigen::MatrixXd(Q_(free, free)).llt().solve(Eigen::VectorXd(rest(free)));
      for (std::size_t k = 0; k < free.size(); ++k) activation_[free[k]] = x[static_cast<Eigen::Index>(k)];
    }
    const Eigen::VectorXd slope = Q_ * activation_ - c_;
    const double loose = 1e-9 * (1 + c_.cwiseAbs().maxCoeff());
    bool right = true;
    for (Eigen::Index i = n; i-- > 0;) {
      signed char& bound = bound_[as_index(static_cast<int>(i))];
      const signed char now = bound != 0                          ? (bound * slope[i] > loose ? 0 : bound)
                              : activation_[i] < least_ - 1e-12   ? -1
                              : activation_[i] > most_[i] + 1e-12 ? 1
                                                                  : 0;
      if (now == bound) continue;
      bound = now;
      right = false;
      if (pass >= kBlockPivots) break;
    }
    if (right) return;
  }
}

std::span<const double> StaticOptimisation::solve(const model::State& state, std::span<const double> torques,
                                                  bool rested) {
  for (int pass = 0; pass < (rested ? kPasses : 1); ++pass) {
    assemble(state, torques, rested, pass > 0);
    minimise();
    if (!spills_) continue;
    tied_.assign(out_.size(), nullptr);
    own_Q_ = Q_, own_c_ = c_;
    for (int i = 0; i < kSpillPasses && tie(); ++i) {
      reduce();
      minimise();
      const Eigen::VectorXd found = activation_;
      for (std::size_t m = 0; m < tied_.size(); ++m) {
        const Root root = root_of(tied_, m);
        activation_[static_cast<Eigen::Index>(m)] =
            tied_[m] ? std::max(least_, root.share * found[root.at()]) : found[root.at()];
      }
    }
    const Eigen::VectorXd chosen = activation_;
    for (std::size_t m = 0; m < tied_.size(); ++m)
      for (const model::Spill& each : model_.muscles[m].spills) {
        double& value = activation_[static_cast<Eigen::Index>(m)];
        value = std::max(value, std::min(1.0, each.share * chosen[each.from]));
      }
  }
  for (std::size_t i = 0; i < out_.size(); ++i) {
    double& value = activation_[static_cast<Eigen::Index>(i)];
    out_[i] = value = std::clamp(value, least_, most_[static_cast<Eigen::Index>(i)]);
  }
  missing_ = wanted_ - arms_ * activation_;
  return out_;
}

void StaticOptimisation::save(ArchiveWriter& out) const {
  for (const signed char bound : bound_) out(bound + 1);
}

void StaticOptimisation::restore(ArchiveReader& in) {
  for (signed char& bound : bound_) bound = static_cast<signed char>(static_cast<int>(in.count(2)) - 1);
}

MuscleDrive::MuscleDrive(const model::Model& model, const MusclePlan& plan, std::vector<std::size_t> dofs,
                         double step)
    : plan_(plan), step_(step), torques_(as_index(model.dof_count())), excitations_(model.muscles.size()) {
  if (!plan.table) optimisation_.emplace(model, std::move(dofs));
}

void MuscleDrive::from_table(double time) {
  const MotionTable& table = *plan_.table;
  const auto next = std::upper_bound(table.times.begin(), table.times.end(), time);
  const auto after = as_index(next - table.times.begin());
  const std::size_t to = std::min(after, table.times.size() - 1), from = after == 0 ? 0 : after - 1;
  const double span = table.times[to] - table.times[from];
  const double share = span > 0 ? (time - table.times[from]) / span : 0;
  for (std::size_t i = 0; i < excitations_.size(); ++i)
    if (const auto column = plan_.columns[i])
      excitations_[i] = (1 - share) * table.at(from, *column) + share * table.at(to, *column);
}

std::span<const double> MuscleDrive::excitations(const model::State& state, std::span<const double> torques,
                                                 std::span<const model::Servo> servos) {
  if (!optimisation_) {
    from_table(state.time + step_);
    return excitations_;
  }
  std::ranges::fill(torques_, 0.0);
  for (std::size_t i = 0; i < torques.size(); ++i) torques_[i] += torques[i];
  for (std::size_t i = 0; i < servos.size(); ++i) {
    const model::Servo& servo = servos[i];
    const double pull =
        servo.stiffness * (servo.error - step_ * state.u[i]) - servo.damping * state.u[i] + servo.feed;
    torques_[i] += std::clamp(pull, -servo.limit, servo.limit);
  }
  const std::span<const double> found = optimisation_->solve(state, torques_);
  std::ranges::copy(found, excitations_.begin());
  return excitations_;
}

}  // namespace handsim::control
