#include "handsim/output/render/parts.h"

#include <algorithm>
#include <cmath>

#include "handsim/output/render/mesh.h"

namespace handsim::output {

namespace {

Buffer upload(const Mesh& mesh, Buffer buffer = {}) {
  buffer.count = static_cast<GLsizei>(mesh.indices.size());
  if (buffer.array == 0) {
    glGenVertexArrays(1, &buffer.array);
    glGenBuffers(2, buffer.data.data());
  }
  glBindVertexArray(buffer.array);
  glBindBuffer(GL_ARRAY_BUFFER, buffer.data[0]);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.vertices.size() * sizeof(Vertex)),
               mesh.vertices.data(), GL_STATIC_DRAW);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, buffer.data[1]);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.indices.size() * sizeof(std::uint32_t)),
               mesh.indices.data(), GL_STATIC_DRAW);
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), nullptr);
  // The other attributes follow the first; OpenGL takes the offset as a pointer.
  glVertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex),
                        reinterpret_cast<const void*>(sizeof(Eigen::Vector3f)));
  glVertexAttribPointer(2, 1, GL_FLOAT, GL_FALSE, sizeof(Vertex),
                        reinterpret_cast<const void*>(2 * sizeof(Eigen::Vector3f)));
  for (const GLuint attribute : {0U, 1U, 2U}) glEnableVertexAttribArray(attribute);
  return buffer;
}

}  // namespace

Eigen::Vector4f rectangle_of(const Solid& solid, const Eigen::Matrix4f& projection) {
  const Vec3 half = solid.half + Vec3::Constant(solid.round);
  Eigen::Array2f low = Eigen::Array2f::Ones(), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 signs((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
    const Vec3 point = solid.pose * Vec3(half.cwiseProduct(signs));
    const Eigen::Vector4f at = projection * Eigen::Vector4d(point.x(), point.y(), point.z(), 1).cast<float>();
    // A corner behind the camera has no place in the picture.
    if (at.w() <= 0) return {-1, -1, 1, 1};
    low = low.min(at.head<2>().array() / at.w());
    high = high.max(at.head<2>().array() / at.w());
  }
  // A float has less precision than the driver's edges.
  low -= 1e-3F;
  high += 1e-3F;
  return {low.x(), low.y(), high.x(), high.y()};
}

Meshes::Meshes()
    : capsule_(upload_round(capsule_mesh)),
      cylinder_(upload_round(cylinder_mesh)),
      box_(upload(box_mesh())),
      cone_(upload(cone_mesh(static_cast<float>(kHeadLength)))),
      ring_(upload(ring_mesh(0.75F))) {}

/// One buffer for each entry of kSides.
Meshes::RoundBuffers Meshes::upload_round(Mesh (*make)(int)) {
  RoundBuffers buffers;
  for (std::size_t i = 0; i < kSides.size(); ++i) buffers[i] = upload(make(kSides[i]));
  return buffers;
}

// The error of a circle of radius r with n sides is r (1 - cos(pi / n)), about r (pi / n)^2 / 2.
Buffer Meshes::fitting(const RoundBuffers& buffers, const LitScene& scene, const DrawShape& shape,
                       int height) {
  const Solid& solid = shape.solid;
  const double nearest = std::max((solid.pose.p - scene.camera.position).norm() - solid.reach(), 1e-6);
  const double focus = height / 2.0 / std::tan(scene.camera.field_of_view / 2);
  const double radius = std::max(solid.round, solid.half.x()) * focus / nearest;
  for (std::size_t i = shape.fine ? 1 : 0; i + 1 < kSides.size(); ++i)
    if (radius * std::pow(M_PI / kSides[i], 2) / 2 < 0.25) return buffers[i];
  return buffers.back();
}

Buffer Meshes::buffer_of(const LitScene& scene, const DrawShape& shape, int height) {
  if (shape.skin) return upload_skin(*shape.skin);
  const Solid& solid = shape.solid;
  if (is_capsule(solid)) return fitting(capsule_, scene, shape, height);
  if (solid.core == Core::box) return box_;
  if (solid.core == Core::cylinder) return fitting(cylinder_, scene, shape, height);
  const auto [found, fresh] = hulls_.try_emplace(solid.mesh);
  if (fresh) found->second = upload(faceted_mesh(*solid.mesh));
  return found->second;
}

Buffer Meshes::upload_skin(const Mesh& mesh) {
  if (used_skins_ == skins_.size()) skins_.emplace_back();
  Buffer& buffer = skins_[used_skins_++];
  return buffer = upload(mesh, buffer);
}

std::vector<Part> Meshes::parts(const LitScene& scene, int height) {
  std::vector<Part> parts;
  used_skins_ = 0;
  for (const LitSolid& lit : scene.solids)
    parts.push_back({lit.solid, lit.colour, buffer_of(scene, lit, height), &lit});
  add_annotations(scene, parts);
  // Two parts of the same number have no smooth edge between them; few pictures have so many.
  for (std::size_t i = 0; i < parts.size(); ++i) parts[i].id = static_cast<float>(1 + i % kIds) / kIds;
  return parts;
}

void Meshes::add_annotations(const LitScene& scene, std::vector<Part>& parts) const {
  for (const DrawPoint& point : scene.list->points)
    parts.push_back({{Core::box, Vec3::Zero(), point.radius, {point.position, Quat::Identity()}, {}},
                     point.colour,
                     capsule_[1]});
  for (const DrawArrow& arrow : scene.list->arrows) {
    const Vec3 along = arrow.to - arrow.from;
    const double length = along.norm();
    if (!(length > 0)) continue;
    const auto add = [&](const Solid& solid, const Buffer& buffer) {
      parts.push_back({solid, arrow.colour, buffer, nullptr, arrow.on_top});
    };
    // A short arrow is thinner.
    const double head = std::min(kHeadLength * kHeadWidth * arrow.radius, 0.6 * length);
    const double width = head / kHeadLength, radius = width / kHeadWidth, shaft = length - head;
    const Vec3 sight = scene.camera.position - arrow.to;
    const double sine = along.cross(sight).norm() / (length * sight.norm());
    const double cosine = std::sqrt(1 - std::min(1.0, sine * sine));
    // A short arrow is a blot, and a longer one, too, unless the tip of its head stands out beside the disc.
    if (std::max(head, shaft) * sine < 1.5 * width || head * sine < width * (cosine + 0.2)) {
      // As in drawings, a ring with a dot points to the reader, a ring with a cross away.
      const Quat q = rotation_between(Vec3::UnitZ(), sight);
      add({Core::cylinder, Vec3::Constant(width), 0, {arrow.to, q}, {}}, ring_);
      if (along.dot(sight) > 0)
        add({Core::box, Vec3::Zero(), 0.3 * width, {arrow.to, q}, {}}, capsule_[1]);
      else
        for (const double angle : {M_PI / 4, -M_PI / 4})
          add({Core::box,
               Vec3(0.9, 0.1, 0.02) * width,
               0,
               {arrow.to, q * Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ()))},
               {}},
              box_);
      continue;
    }
    const Quat q = rotation_between(Vec3::UnitZ(), along);
    const Vec3 neck = arrow.from + along * (shaft / length);
    add({Core::cylinder, {radius, radius, shaft / 2}, 0, {(arrow.from + neck) / 2, q}, {}}, cylinder_[1]);
    add({Core::cylinder, {width, width, head}, 0, {neck, q}, {}}, cone_);
  }
}

}  // namespace handsim::output
