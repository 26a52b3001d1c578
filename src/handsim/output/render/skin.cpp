#include "handsim/output/render/skin.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <mutex>
#include <tuple>

#include "handsim/output/render/mesh.h"
#include "handsim/output/render/skin_field.h"

namespace handsim::output {

namespace {

/// Cells of the grid over the hand's length: 8,500 to 11,000 triangles.
constexpr double kCells = 54;
/// Samples of the edge of the largest block; blocks far from the skin are not sampled.
constexpr int kBlock = 4;
constexpr int kRelaxations = 4, kShareRelaxations = 12, kWeightRelaxations = 3;

using Corner = Eigen::Vector3i;
Corner corner_of(int bits) { return {bits & 1, bits >> 1 & 1, bits >> 2 & 1}; }

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
    return (as_index(c.z()) * as_index(size_.y()) + as_index(c.y())) * as_index(size_.x()) + as_index(c.x());
  }
  bool inside(const Corner& c) const { return values_[index(c)] < 0; }
  int corners_inside(const Corner& cell) const {
    int bits = 0;
    for (int i = 0; i < 8; ++i) bits |= inside(cell + corner_of(i)) << i;
    return bits;
  }
  Vec3 place(const Corner& c) const { return low_ + cell_ * c.cast<double>(); }
  void sample(const Corner& first, int size);
  bool fill(const Corner& c, int a, int b);
  bool fill(const Corner& c);
  Vec3 vertex(const Corner& cell) const;

  const SkinField& field_;
  double cell_;
  Vec3 low_;
  Corner size_;
  std::vector<double> values_;
  std::vector<char> near_;     ///< of each sample, whether its cell is one of
  std::vector<Corner> cells_;  ///< by their lowest corners: all that the surface may pass through
};

Grid::Grid(const SkinField& field, double cell) : field_(field), cell_(cell) {
  low_ = field.low - Vec3::Constant(2 * cell);
  const Vec3 extent = (field.high - low_) / (cell * kBlock);
  size_ = kBlock * (extent.array().ceil().cast<int>() + 1).matrix();
  values_.resize(as_index(size_.prod()));
  near_.resize(values_.size());
  for (int z = 0; z < size_.z(); z += kBlock)
    for (int y = 0; y < size_.y(); y += kBlock)
      for (int x = 0; x < size_.x(); x += kBlock) sample({x, y, z}, kBlock);
  for (int z = 0; z < size_.z() - 1; ++z)
    for (int y = 0; y < size_.y() - 1; ++y)
      for (int x = 0; x < size_.x() - 1; ++x)
        if (near_[index({x, y, z})] != 0) cells_.emplace_back(x, y, z);
}

/// The field grows no faster than the distance: one sample excludes a block whose samples are all further
/// than a cell from the surface.
void Grid::sample(const Corner& first, int size) {
  const double half = 0.5 * (size - 1), d = field_(place(first) + Vec3::Constant(half * cell_));
  if (size == 1) {
    values_[index(first)] = d;
    for (int k = 0; k < 8; ++k) near_[index((first - corner_of(k)).cwiseMax(0))] = 1;
  } else if (std::abs(d) < (half * std::sqrt(3) + 1) * cell_) {
    for (int k = 0; k < 8; ++k) sample(first + size / 2 * corner_of(k), size / 2);
  } else {
    for (int k = 0; k < size * size * size; ++k)
      values_[index(first + Corner(k % size, k / size % size, k / (size * size)))] = d;
  }
}

/// Fills a corner of a square along two axes with only opposite corners inside: four faces would meet.
bool Grid::fill(const Corner& c, int a, int b) {
  const Corner p = c + Corner::Unit(a), q = c + Corner::Unit(b), r = p + Corner::Unit(b);
  if (inside(c) != inside(r) || inside(p) != inside(q) || inside(c) == inside(p)) return false;
  values_[index(inside(c) ? p : c)] = -1e-3 * cell_;
  return true;
}

/// Fills a corner of a cube with only opposite corners inside, or outside: two sheets would meet in it.
bool Grid::fill(const Corner& c) {
  const int bits = corners_inside(c);
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
    for (const Corner& c : cells_) {
      if (const int bits = corners_inside(c); bits == 0 || bits == 0xFF) continue;
      for (const auto& [a, b] : {std::pair(0, 1), {1, 2}, {2, 0}}) changed = fill(c, a, b) || changed;
      changed = fill(c) || changed;
    }
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
  for (const Corner& cell : cells_) {
    if (const int bits = corners_inside(cell); bits == 0 || bits == 0xFF) continue;
    numbers[index(cell)] = static_cast<std::uint32_t>(skin.points.size());
    skin.points.push_back(vertex(cell));
  }
  for (const Corner& c : cells_)
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
}

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Replaces rows by the mean over the neighbours of each vertex, by edge; eight columns at once.
void smooth(const Skin& skin, Rows& rows, int times) {
  for (long from = 0; from < rows.cols(); from += 8) {
    const long width = std::min(rows.cols() - from, 8L);
    Eigen::Array<float, Eigen::Dynamic, 8, Eigen::RowMajor> part(rows.rows(), 8), sum(rows.rows(), 8);
    part.setZero();
    part.leftCols(width) = rows.middleCols(from, width);
    for (int k = 0; k < times; ++k) {
      sum.setZero();
      Eigen::ArrayXf count = Eigen::ArrayXf::Zero(rows.rows());
      for (const auto& face : skin.faces)
        for (int i = 0; i < 3; ++i) {
          sum.row(face[as_index(i)]) += part.row(face[as_index((i + 1) % 3)]);
          count[face[as_index(i)]] += 1;
        }
      part = sum.colwise() / count;
    }
    rows.middleCols(from, width) = part.leftCols(width);
  }
}

/// Evens out the triangles along the surface. Its normals are about the field's gradients.
void relax(Skin& skin, const SkinField& field, double cell) {
  Rows rows(static_cast<long>(skin.points.size()), 3);
  for (int k = 0; k <= kRelaxations; ++k) {
    const std::vector<Vec3> normals = normals_of(skin, skin.points);
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
      if (k % 2 == 0) skin.points[i] -= std::clamp(field(skin.points[i]), -cell, cell) * normals[i];
      rows.row(static_cast<long>(i)) = skin.points[i].cast<float>();
    }
    if (k == kRelaxations) return;
    smooth(skin, rows, 1);
    for (std::size_t i = 0; i < skin.points.size(); ++i) {
      const Vec3 mean = rows.row(static_cast<long>(i)).cast<double>(), step = 0.5 * (mean - skin.points[i]);
      skin.points[i] += k + 1 < kRelaxations ? step : step - step.dot(normals[i]) * normals[i];
    }
  }
}

void set_weights(Skin& skin, const SkinField& field) {
  const auto count = static_cast<long>(skin.points.size());
  Rows shares(count, field.distances(skin.points[0]).size() - 1);
  std::vector<int> nearest;
  for (long i = 0; i < count; ++i) {
    const Eigen::VectorXd distances = field.distances(skin.points[as_index(i)]);
    shares.row(i) = field.shares(distances);
    skin.finger.push_back(static_cast<float>(field.beyond_palm(distances)));
    nearest.push_back(field.nearest_shape(skin.points[as_index(i)]));
  }
  for (const auto& face : skin.faces) skin.shapes.push_back(nearest[face[0]]);
  // A web between a bent and a straight finger turns over unless it is wide.
  smooth(skin, shares, kShareRelaxations);
  Rows weights(count, static_cast<long>(skin.bodies.size()));
  for (long i = 0; i < count; ++i) weights.row(i) = field.weights(skin.points[as_index(i)], shares.row(i));
  smooth(skin, weights, kWeightRelaxations);
  skin.weights = weights;
}

/// A nail's colour is this share of the way from the skin's colour to white.
constexpr float kNailShare = 0.2F;
constexpr std::size_t kKept = 16;

/// A skin that was made, and what it is of: a left hand's is the mirror image of a right hand's.
struct Kept {
  std::vector<std::int64_t> key;
  model::Side side;
  std::vector<int> bodies, shapes;  ///< indices into the model's
  std::shared_ptr<const Skin> skin = nullptr;
};

/// The skin of `like` for another hand of the same key.
Skin renamed(const Kept& like, const Kept& now) {
  const auto rename = [](std::vector<int>& indices, const std::vector<int>& from,
                         const std::vector<int>& to) {
    for (int& index : indices) index = to[as_index(std::ranges::find(from, index) - from.begin())];
  };
  Skin out = *like.skin;
  rename(out.bodies, like.bodies, now.bodies);
  rename(out.shapes, like.shapes, now.shapes);
  if (like.side == now.side) return out;
  for (Pose& rest : out.rest) rest = mirrored(rest);
  for (Vec3& point : out.points) point.x() *= -1;
  for (auto& face : out.faces) std::swap(face[1], face[2]);
  return out;
}

Skin make_skin(const SkinField& field) {
  const double cell = field.length / kCells;
  Skin skin;
  skin.bodies = field.bodies;
  skin.rest = field.rest;
  Grid grid(field, cell);
  grid.separate();
  grid.polygonise(skin);
  relax(skin, field, cell);
  set_weights(skin, field);
  return skin;
}

/// The faces nearest to each shape as a mesh, by shape.
std::vector<std::shared_ptr<Mesh>> pieces(const Skin& skin, const std::vector<Vec3>& points,
                                          std::size_t shapes) {
  const std::vector<Vec3> normals = normals_of(skin, points);
  std::vector<std::shared_ptr<Mesh>> out(shapes);
  std::vector<std::pair<int, std::uint32_t>> numbers(points.size(), {-1, 0});
  std::vector<std::vector<std::size_t>> faces(shapes);
  for (std::size_t i = 0; i < skin.faces.size(); ++i) faces[as_index(skin.shapes[i])].push_back(i);
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
  return make_skin(SkinField(model, hand));
}

std::vector<std::shared_ptr<const Skin>> skins_of(const model::Model& model) {
  static std::mutex mutex;
  static std::deque<Kept> kept;
  const std::lock_guard lock(mutex);
  std::vector<std::shared_ptr<const Skin>> out;
  for (const model::HandIndex& hand : model.hands) {
    const SkinField field(model, hand);
    Kept now = {field.key(hand.side == model::Side::left), hand.side, field.bodies, field.shapes()};
    const Kept* like = nullptr;
    for (const Kept& each : kept) {
      if (each.key != now.key) continue;
      like = &each;
      if (std::tie(each.side, each.bodies, each.shapes) == std::tie(now.side, now.bodies, now.shapes))
        now.skin = each.skin;
    }
    if (!now.skin) {
      now.skin = std::make_shared<const Skin>(like ? renamed(*like, now) : make_skin(field));
      kept.push_back(now);
      if (kept.size() > kKept) kept.pop_front();
    }
    out.push_back(now.skin);
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
  for (const int body : skin.bodies) bodies.push_back(state.bodies[as_index(body)].pose());
  const auto meshes = pieces(skin, posed(skin, bodies), model.shapes.size());
  const auto covered = [&](const DrawShape& drawn) {
    return std::ranges::find(skin.bodies, model.shapes[as_index(drawn.shape)].body) != skin.bodies.end();
  };
  std::erase_if(list.shapes, [&](const DrawShape& drawn) {
    return drawn.mark && covered(drawn) && model.shapes[as_index(drawn.shape)].body == skin.bodies[0];
  });
  for (DrawShape& drawn : list.shapes) {
    // A forearm has no skin of its own.
    if (!covered(drawn) && model.shapes[as_index(drawn.shape)].part == model::Part::palm) drawn.colour = tone;
    if (!covered(drawn)) continue;
    if (!drawn.mark) drawn.skin = meshes[as_index(drawn.shape)];
    // A pad of the palm that a finger carries may come through the skin between them.
    const model::Shape& shape = model.shapes[as_index(drawn.shape)];
    if (shape.part == model::Part::palm && shape.body != skin.bodies[0]) drawn.shades = false;
    const bool of_finger = model.shapes[as_index(drawn.shape)].part != model::Part::palm;
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
