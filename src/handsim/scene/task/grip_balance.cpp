#include "handsim/scene/task/grip_balance.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>

#include "handsim/hand/hand_file.h"
#include "handsim/scene/read/blocks.h"
#include "handsim/scene/task/tasks.h"

namespace handsim::scene {

namespace {

constexpr int kEdges = 8;
/// Weights of an asked force and of small forces; equilibrium has 1.
constexpr double kAskedWeight = 0.1, kSmallWeight = 8e-3;

/// min |D x - d|^2 + small^2 |x|^2 with x >= 0: Lawson & Hanson 1974, Solving Least Squares Problems, ch. 23.
/// D has few rows: with the free columns F the solution is F^T y, (F F^T + small^2) y = d.
Eigen::VectorXd solve_nonnegative(const Eigen::MatrixXd& rows, const Eigen::VectorXd& d, double small) {
  const Eigen::Index n = rows.cols(), m = rows.rows();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::Index> free;
  std::vector<double> trial;
  const double least = 1e-10 * (1 + (rows.transpose() * d).cwiseAbs().maxCoeff());
  const auto solve_free = [&] {
    Eigen::MatrixXd square = small * small * Eigen::MatrixXd::Identity(m, m);
    for (const Eigen::Index i : free) square.noalias() += rows.col(i) * rows.col(i).transpose();
    const Eigen::VectorXd y = square.ldlt().solve(d);
    trial.clear();
    for (const Eigen::Index i : free) trial.push_back(rows.col(i).dot(y));
  };
  for (Eigen::Index round = 0; round < 3 * n; ++round) {
    Eigen::VectorXd gradient = rows.transpose() * (d - rows * x) - small * small * x;
    for (const Eigen::Index i : free) gradient[i] = 0;
    Eigen::Index most = 0;
    if (gradient.maxCoeff(&most) <= least) break;
    free.push_back(most);
    while (!free.empty()) {
      solve_free();
      double share = 1;
      for (std::size_t i = 0; i < free.size(); ++i)
        if (trial[i] <= 0) share = std::min(share, x[free[i]] / (x[free[i]] - trial[i]));
      for (std::size_t i = 0; i < free.size(); ++i) x[free[i]] += share * (trial[i] - x[free[i]]);
      if (share >= 1) break;
      std::erase_if(free, [&](Eigen::Index i) {
        if (x[i] > 1e-12) return false;
        x[i] = 0;
        return true;
      });
    }
  }
  return x;
}

/// Contacts that share a normal force.
struct Part {
  std::size_t first = 0, last = 0;
  Vec3 middle = Vec3::Zero(), normal;

  Part(const GripTask& task, std::size_t i) : first(i), last(i), normal(task.contacts[i].normal) {
    if (const auto& of = task.contacts[i].part) std::tie(first, last) = *of;
    if (first == last) return;
    normal *= 1e-9;  // all of several normals that are opposite have some direction, too
    for (std::size_t k = first; k <= last; ++k) {
      middle += task.contacts[k].share * task.contacts[k].point;
      normal += task.contacts[k].share * task.contacts[k].normal;
    }
    normal.normalize();
  }
  /// The edges, and of several points the two turns about their normal.
  int columns() const { return first == last ? kEdges : kEdges + 2; }
  /// Force of one of its contacts for a normal force of 1 of all, with friction along an edge or a turn.
  Vec3 force(const GripContact& contact, int column) const {
    const Vec3 t = normal.unitOrthogonal();
    const double angle = 2 * M_PI * column / kEdges;
    Vec3 along = std::cos(angle) * t + std::sin(angle) * normal.cross(t);
    if (first == last) return contact.normal + contact.friction * along;
    if (column >= kEdges) along = (column == kEdges ? 1 : -1) * normal.cross(contact.point - middle);
    along -= along.dot(contact.normal) * contact.normal;
    return contact.share * (contact.normal + contact.friction * along.stableNormalized());
  }
};

}  // namespace

GripForces balance(const GripTask& task) {
  GripForces out;
  out.forces.assign(task.contacts.size(), Vec3::Zero());
  std::vector<Part> parts;
  Eigen::Index n = 0;
  for (std::size_t i = 0; i < task.contacts.size(); i = parts.back().last + 1)
    n += parts.emplace_back(task, i).columns();
  if (n == 0) return out;
  const auto pressers = static_cast<Eigen::Index>(task.asked.size());
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(6 + pressers, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(6 + pressers);
  b.head<3>() = -task.load;
  for (Eigen::Index i = 0; i < pressers; ++i) b[6 + i] = kAskedWeight * task.asked[as_index(i)].value_or(0);
  Eigen::Index k = 0;
  for (const Part& part : parts)
    for (int column = 0; column < part.columns(); ++column, ++k) {
      for (std::size_t i = part.first; i <= part.last; ++i) {
        const GripContact& contact = task.contacts[i];
        const Vec3 force = part.force(contact, column);
        a.block<3, 1>(0, k) += force;
        a.block<3, 1>(3, k) += (contact.point - task.centre).cross(force) / task.size;
      }
      const std::size_t presser = task.contacts[part.first].presser;
      if (task.asked[presser]) a(6 + static_cast<Eigen::Index>(presser), k) = kAskedWeight;
    }
  const Eigen::VectorXd x = solve_nonnegative(a, b, kSmallWeight);
  k = 0;
  for (const Part& part : parts)
    for (int column = 0; column < part.columns(); ++column, ++k)
      for (std::size_t i = part.first; i <= part.last; ++i)
        out.forces[i] += x[k] * part.force(task.contacts[i], column);
  const double sum = x.sum();
  out.unbalanced = sum > 0 ? (a * x - b).head<6>().norm() / sum : 1;
  return out;
}

double load_share(const GripTask& task, const GripForces& forces, const std::vector<Vec3>& loads) {
  using Mat6 = Eigen::Matrix<double, 6, 6>;
  using Vec6 = Eigen::Matrix<double, 6, 1>;
  Mat6 holds = 1e-12 * Mat6::Identity();  // no contact: a share that is very large
  for (std::size_t i = 0; i < task.contacts.size(); ++i) {
    const GripContact& contact = task.contacts[i];
    const Vec3& n = contact.normal;
    const double normal = forces.forces[i].dot(n);
    const double slides = std::max(0.0, contact.limit * normal - (forces.forces[i] - normal * n).norm());
    Eigen::Matrix<double, 6, 4> of;
    const Vec3 t = n.unitOrthogonal();
    for (const auto& [column, force] :
         {std::pair<int, Vec3>(0, normal * n), std::pair<int, Vec3>(1, slides * t),
          std::pair<int, Vec3>(2, slides * n.cross(t))})
      of.col(column) << force, (contact.point - task.centre).cross(force);
    of.col(3) << Vec3::Zero(), contact.spinning * normal * n;
    holds += of * of.transpose();
  }
  const Eigen::LDLT<Mat6> solver(holds);
  double most = 0;
  for (const Vec3& load : loads) {
    Vec6 wrench;
    wrench << load, Vec3::Zero();
    most = std::max(most, wrench.dot(solver.solve(wrench)));
  }
  return std::sqrt(most);
}

GripSpec read_grip(MapReader reader) {
  GripSpec out;
  MapReader forces = reader.required_map("forces", "a mapping of fingers to forces");
  for (const auto& [name, part] : hand::kFingers)
    if (forces.has(name)) out.forces[part] = forces.number(name, {Dimension::force, 0, 1e3});
  if (forces.sound() && out.forces.empty()) forces.problem("", "no finger", "a force of at least one finger");
  forces.finish();
  if (const YamlNode* table = referenced(reader, "strength", FileKind::grip_norms))
    out.strength = hand::read_grip_table(*table, reader.path_of("strength"), reader.diagnostics());
  out.squeeze = reader.number("squeeze", kSpan, out.squeeze);
  out.friction = reader.maybe_number("friction", {Dimension::none, 1e-3, 100});
  out.reserve = reader.number("reserve", {Dimension::none, 1, 10}, out.reserve);
  out.search = reader.number("search", {Dimension::none, 0, 0.5}, out.search);
  reader.finish();
  return out;
}

std::string_view part_name(model::Part part) {
  for (const auto& [name, finger] : hand::kFingers)
    if (finger == part) return name;
  return "palm";
}

}  // namespace handsim::scene
