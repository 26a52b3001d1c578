#include "handsim/output/render/skin.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <mutex>

#include "handsim/core/index.h"
#include "handsim/output/render/mesh.h"
#include "handsim/output/render/skin_field.h"

namespace handsim::output {

namespace {

/// Cells of the grid over the hand's length: 10,000 to 14,000 triangles.
constexpr double kCells = 62;
/// Samples of a block's edge; blocks far from the skin are not sampled.
constexpr int kBlock = 4;
constexpr int kRelaxations = 3, kShareRelaxations = 12, kWeightRelaxations = 2;

using Corner = Eigen::Vector3i;

/// Samples of a field. Surface nets (Gibson 1998, MICCAI): the surface has a vertex in every cell with
/// corners of both signs and a quad across every edge with ends of both, so it has the topology of the
/// boundary of the voxels about the inner samples, and no tables.
class Grid {
 public:
  Grid(const SkinField& field, double cell);

  void separate();
  void polygonise(Skin& skin) const;

 private:
  std::size_t index(const Corner& c) const {
    return (at(c.z()) * at(size_.y()) + at(c.y())) * at(size_.x()) + at(c.x());
  }
  bool inside(const Corner& c) const { return values_[index(c)] < 0; }
  Vec3 place(const Corner& c) const { return low_ + cell_ * c.cast<double>(); }
  void sample_block(const Corner& first);
  bool fill(const Corner& c, int a, int b);
  bool fill(const Corner& c);
  Vec3 vertex(const Corner& cell) const;
  template <class Each>
  void each(int border, Each each) const {
    for (int z = 0; z < size_.z() - border; ++z)
      for (int y = 0; y < size_.y() - border; ++y)
        for (int x = 0; x < size_.x() - border; ++x) each(Corner(x, y, z));
  }

  const SkinField& field_;
  double cell_;
  Vec3 low_;
  Corner size_;
  std::vector<double> values_;
};

Corner corner_of(int bits) { return {bits & 1, bits >> 1 & 1, bits >> 2 & 1}; }

Grid::Grid(const SkinField& field, double cell) : field_(field), cell_(cell) {
  low_ = field.low - Vec3::Constant(2 * cell);
  const Vec3 extent = (field.high - low_) / (cell * kBlock);
  size_ = kBlock * (extent.array().ceil().cast<int>() + 1).matrix();
  values_.resize(at(size_.prod()));
  for (int z = 0; z < size_.z(); z += kBlock)
    for (int y = 0; y < size_.y(); y += kBlock)
      for (int x = 0; x < size_.x(); x += kBlock) sample_block({x, y, z});
}

/// The field grows no faster than the distance: one sample excludes a block.
void Grid::sample_block(const Corner& first) {
  const Vec3 middle = place(first) + Vec3::Constant(0.5 * (kBlock - 1) * cell_);
  const double of_middle = field_(middle).d;
  const bool far = std::abs(of_middle) > 0.5 * kBlock * cell_ * std::sqrt(3) * 1.2;
  for (int i = 0; i < kBlock * kBlock * kBlock; ++i) {
    const Corner c = first + Corner(i % kBlock, i / kBlock % kBlock, i / (kBlock * kBlock));
    values_[index(c)] = far ? of_middle : field_(place(c)).d;
  }
}

/// Of a square along two axes with only opposite corners inside, fills one: at its edge four faces would
/// meet.
bool Grid::fill(const Corner& c, int a, int b) {
  const Corner p = c + Corner::Unit(a), q = c + Corner::Unit(b), r = p + Corner::Unit(b);
  if (inside(c) != inside(r) || inside(p) != inside(q) || inside(c) == inside(p)) return false;
  values_[index(inside(c) ? p : c)] = -1e-3 * cell_;
  return true;
}

/// Of a cube with only opposite corners inside, or outside, fills one: at its centre two sheets would meet.
bool Grid::fill(const Corner& c) {
  int bits = 0;
  for (int i = 0; i < 8; ++i) bits |= inside(c + corner_of(i)) << i;
  for (int i = 0; i < 4; ++i) {
    const int pair = 1 << i | 1 << (7 - i);
    if (bits != pair && bits != (~pair & 0xFF)) continue;
    values_[index(c + corner_of(bits == pair ? i ^ 1 : i))] = -1e-3 * cell_;
    return true;
  }
  return false;
}

/// Makes the boundary a manifold (a well-composed set: Latecki 1997, CVIU 61:70).
void Grid::separate() {
  for (bool changed = true; changed;) {
    changed = false;
    each(1, [&](const Corner& c) {
      for (const auto& [a, b] : {std::pair(0, 1), {1, 2}, {2, 0}}) changed = fill(c, a, b) || changed;
      changed = fill(c) || changed;
    });
  }
}

/// Mean of where the cell's edges cross the surface.
Vec3 Grid::vertex(const Corner& cell) const {
  Vec3 sum = Vec3::Zero();
  int count = 0;
  for (int i = 0; i < 8; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      if ((i >> axis & 1) != 0) continue;
      const Corner from = cell + corner_of(i), to = from + Corner::Unit(axis);
      const double a = values_[index(from)], b = values_[index(to)];
      if ((a < 0) == (b < 0)) continue;
      sum += place(from) + a / (a - b) * cell_ * Vec3::Unit(axis);
      ++count;
    }
  return sum / count;
}

void Grid::polygonise(Skin& skin) const {
  std::vector<std::uint32_t> numbers(values_.size());
  each(1, [&](const Corner& cell) {
    int in = 0;
    for (int i = 0; i < 8; ++i) in += inside(cell + corner_of(i));
    if (in == 0 || in == 8) return;
    numbers[index(cell)] = static_cast<std::uint32_t>(skin.points.size());
    skin.points.push_back(vertex(cell));
  });
  each(1, [&](const Corner& c) {
    for (int axis = 0; axis < 3; ++axis) {
      if (inside(c) == inside(c + Corner::Unit(axis))) continue;
      const Corner u = Corner::Unit((axis + 1) % 3), v = Corner::Unit((axis + 2) % 3);
      std::array<std::uint32_t, 4> quad = {numbers[index(c - u - v)], numbers[index(c - v)],
                                           numbers[index(c)], numbers[index(c - u)]};
      if (!inside(c)) std::swap(quad[1], quad[3]);
      const auto& p = skin.points;
      const bool turned = (p[quad[0]] - p[quad[2]]).norm() > (p[quad[1]] - p[quad[3]]).norm();
      if (turned) std::rotate(quad.begin(), quad.begin() + 1, quad.end());
      skin.faces.push_back({quad[0], quad[1], quad[2]});
      skin.faces.push_back({quad[0], quad[2], quad[3]});
    }
  });
}

/// Newton's step onto the surface, at most a cell long.
Vec3 onto(const SkinField& field, const Vec3& x, double cell) {
  const Sample at = field(x);
  const Vec3 step = -at.d / std::max(at.gradient.squaredNorm(), 0.25) * at.gradient;
  return x + std::min(1.0, cell / std::max(step.norm(), 1e-12)) * step;
}

/// The mean of a quantity over the neighbours of each vertex, by edge.
template <class Rows>
Rows mean_of_neighbours(const Skin& skin, const Rows& rows) {
  Rows sum = Rows::Zero(rows.rows(), rows.cols());
  Eigen::VectorXf count = Eigen::VectorXf::Zero(rows.rows());
  for (const auto& face : skin.faces)
    for (int i = 0; i < 3; ++i) {
      sum.row(face[at(i)]) += rows.row(face[at((i + 1) % 3)]);
      count[face[at(i)]] += 1;
    }
  for (long i = 0; i < rows.rows(); ++i) sum.row(i) /= count[i];
  return sum;
}

/// Evens out the triangles along the surface.
void relax(Skin& skin, const SkinField& field, double cell) {
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> rows(static_cast<long>(skin.points.size()), 3);
  for (int k = 0; k <= kRelaxations; ++k) {
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
      skin.points[i] = onto(field, skin.points[i], cell);
      rows.row(static_cast<long>(i)) = skin.points[i];
    }
    if (k == kRelaxations) return;
    const auto mean = mean_of_neighbours(skin, rows);
    for (std::size_t i = 0; i < skin.points.size(); ++i)
      skin.points[i] += 0.5 * (mean.row(static_cast<long>(i)).transpose() - skin.points[i]);
  }
}

void set_weights(Skin& skin, const SkinField& field) {
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto of_points = [&](long columns, auto at_point) {
    Rows out(static_cast<long>(skin.points.size()), columns);
    for (long i = 0; i < out.rows(); ++i) out.row(i) = at_point(skin.points[at(i)], i);
    return out;
  };
  Rows shares = of_points(field.shares(skin.points[0]).size(),
                          [&](const Vec3& point, long) { return field.shares(point); });
  // A web between a bent and a straight finger turns over unless it is wide.
  for (int k = 0; k < kShareRelaxations; ++k) shares = mean_of_neighbours(skin, shares);
  Rows weights = of_points(static_cast<long>(skin.bodies.size()),
                           [&](const Vec3& point, long i) { return field.weights(point, shares.row(i)); });
  for (int k = 0; k < kWeightRelaxations; ++k) weights = mean_of_neighbours(skin, weights);
  skin.weights = weights;
}

/// Of a nail: from the skin's colour to white.
constexpr float kNailShare = 0.2F;
constexpr std::size_t kKept = 16;

/// All that a skin follows from.
std::vector<double> key_of(const model::Model& model, const model::HandIndex& hand) {
  std::vector<double> out = {static_cast<double>(hand.palm), static_cast<double>(hand.palm_parts.size())};
  const auto add = [&out](const auto& v) { out.insert(out.end(), v.data(), v.data() + v.size()); };
  std::vector<int> bodies = hand.bodies;
  add(hand.wrist_frame.p);
  for (const int body : bodies) {
    add(model.bodies[at(body)].zero_pose.p);
    add(model.bodies[at(body)].zero_pose.q.coeffs());
  }
  for (const model::Shape& shape : model.shapes) {
    out.push_back(static_cast<double>(std::ranges::find(bodies, shape.body) - bodies.begin()));
    if (out.back() == static_cast<double>(bodies.size())) continue;
    add(shape.pose.p);
    add(shape.pose.q.coeffs());
    add(shape.edges);
    out.insert(out.end(), {shape.radius, shape.length, static_cast<double>(shape.part)});
  }
  return out;
}

/// The faces nearest to each shape as a mesh, by shape.
std::vector<std::shared_ptr<Mesh>> pieces(const Skin& skin, const std::vector<Vec3>& points,
                                          std::size_t shapes) {
  const std::vector<Vec3> normals = normals_of(skin, points);
  std::vector<std::shared_ptr<Mesh>> out(shapes);
  std::vector<std::pair<int, std::uint32_t>> numbers(points.size(), {-1, 0});
  std::vector<std::vector<std::size_t>> faces(shapes);
  for (std::size_t i = 0; i < skin.faces.size(); ++i) faces[at(skin.shapes[i])].push_back(i);
  for (std::size_t shape = 0; shape < shapes; ++shape) {
    out[shape] = std::make_shared<Mesh>();
    Mesh& mesh = *out[shape];
    for (const std::size_t i : faces[shape])
      for (const std::uint32_t corner : skin.faces[i]) {
        auto& [of, number] = numbers[corner];
        if (of != static_cast<int>(shape)) {
          of = static_cast<int>(shape);
          number = static_cast<std::uint32_t>(mesh.vertices.size());
          mesh.vertices.push_back(
              {points[corner].cast<float>(), normals[corner].cast<float>(), skin.finger[corner]});
        }
        mesh.indices.push_back(number);
      }
  }
  return out;
}

}  // namespace

Skin make_skin(const model::Model& model, const model::HandIndex& hand) {
  const SkinField field(model, hand);
  const double cell = field.length / kCells;
  Skin skin;
  skin.bodies = field.bodies;
  skin.rest = field.rest;
  Grid grid(field, cell);
  grid.separate();
  grid.polygonise(skin);
  relax(skin, field, cell);
  set_weights(skin, field);
  std::vector<int> nearest;
  for (const Vec3& point : skin.points) {
    nearest.push_back(field.nearest_shape(point));
    skin.finger.push_back(static_cast<float>(field.beyond_palm(point)));
  }
  for (const auto& face : skin.faces) skin.shapes.push_back(nearest[face[0]]);
  return skin;
}

std::vector<std::shared_ptr<const Skin>> skins_of(const model::Model& model) {
  static std::mutex mutex;
  static std::deque<std::pair<std::vector<double>, std::shared_ptr<const Skin>>> kept;
  const std::lock_guard lock(mutex);
  std::vector<std::shared_ptr<const Skin>> out;
  for (const model::HandIndex& hand : model.hands) {
    std::vector<double> key = key_of(model, hand);
    auto found = std::ranges::find(kept, key, [](const auto& each) { return each.first; });
    if (found == kept.end()) {
      if (kept.size() == kKept) kept.pop_front();
      kept.emplace_back(std::move(key), std::make_shared<const Skin>(make_skin(model, hand)));
      found = kept.end() - 1;
    }
    out.push_back(found->second);
  }
  return out;
}

std::vector<Vec3> posed(const Skin& skin, std::span<const Pose> bodies) {
  // A motion of q and t as the quaternions q and t q / 2, one above the other.
  Eigen::Matrix<double, 8, Eigen::Dynamic> motions(8, static_cast<long>(bodies.size()));
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const Pose motion = bodies[b] * skin.rest[b].inverse();
    const Vec3 half = motion.p / 2;
    motions.col(static_cast<long>(b)) << motion.q.coeffs(),
        (Quat(0, half.x(), half.y(), half.z()) * motion.q).coeffs();
  }
  std::vector<Vec3> out;
  out.reserve(skin.points.size());
  for (std::size_t i = 0; i < skin.points.size(); ++i) {
    Eigen::Matrix<double, 8, 1> sum = Eigen::Matrix<double, 8, 1>::Zero();
    for (long b = 0; b < motions.cols(); ++b) {
      const auto share = static_cast<double>(skin.weights(static_cast<long>(i), b));
      // q and -q are one rotation.
      if (share > 0)
        sum += std::copysign(share, sum.head<4>().dot(motions.col(b).head<4>())) * motions.col(b);
    }
    sum /= sum.head<4>().norm();
    const Quat turn(Eigen::Vector4d(sum.head<4>())), move(Eigen::Vector4d(sum.tail<4>()));
    out.push_back(turn * skin.points[i] + 2 * (move * turn.conjugate()).vec());
  }
  return out;
}

void put_on(const Skin& skin, const model::Model& model, const model::State& state, const Colour& tone,
            bool coloured, DrawList& list) {
  std::vector<Pose> bodies;
  for (const int body : skin.bodies) bodies.push_back(state.bodies[at(body)].pose());
  const auto meshes = pieces(skin, posed(skin, bodies), model.shapes.size());
  const auto covered = [&](const DrawShape& drawn) {
    return std::ranges::find(skin.bodies, model.shapes[at(drawn.shape)].body) != skin.bodies.end();
  };
  std::erase_if(list.shapes, [&](const DrawShape& drawn) {
    return drawn.mark && covered(drawn) && model.shapes[at(drawn.shape)].body == skin.bodies[0];
  });
  for (DrawShape& drawn : list.shapes) {
    // A forearm has no skin of its own.
    if (!covered(drawn) && model.shapes[at(drawn.shape)].part == model::Part::palm) drawn.colour = tone;
    if (!covered(drawn)) continue;
    if (!drawn.mark) drawn.skin = meshes[at(drawn.shape)];
    const bool of_finger = model.shapes[at(drawn.shape)].part != model::Part::palm;
    drawn.finger = coloured && of_finger ? drawn.colour : tone;
    if (!coloured || !drawn.mark) drawn.colour = drawn.mark ? mixed(tone, {1, 1, 1}, kNailShare) : tone;
  }
}

std::vector<Vec3> normals_of(const Skin& skin, const std::vector<Vec3>& points) {
  std::vector<Vec3> out(points.size(), Vec3::Zero());
  for (const auto& face : skin.faces) {
    const Vec3& a = points[face[0]];
    const Vec3 area = (points[face[1]] - a).cross(points[face[2]] - a);
    for (const std::uint32_t corner : face) out[corner] += area;
  }
  for (Vec3& normal : out) normal.normalize();
  return out;
}

}  // namespace handsim::output
