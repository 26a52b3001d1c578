// The skin of a hand, for pictures and files: a closed surface about its shapes that bends with its bodies.
// The shapes' distance fields are joined smoothly along the kinematic tree, fingers among each other only at
// their webs. Contact knows nothing of it. Nothing here needs OpenGL.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "handsim/model/model.h"
#include "handsim/model/state.h"
#include "handsim/output/render/draw_list.h"

namespace handsim::output {

/// Vertices are by row, bodies by column. Made with fingers spread further than they move, so that a grid
/// resolves the gaps between them; posed() brings it into any posture.
struct Skin {
  std::vector<int> bodies;                          ///< indices into Model::bodies, the palm first
  std::vector<Pose> rest;                           ///< X_HB of the bodies, spread
  std::vector<Vec3> points;                         ///< in the hand frame, spread [m]
  std::vector<std::array<std::uint32_t, 3>> faces;  ///< corners, counter-clockwise seen from outside
  std::vector<int> shapes;    ///< of each face the nearest shape: index into Model::shapes
  Eigen::MatrixXf weights;    ///< share of each body in the motion of each vertex; rows sum to 1
  std::vector<float> finger;  ///< of each vertex, see SkinField::beyond_palm
};

/// @throws Error (input) for a hand whose palm has no shape.
Skin make_skin(const model::Model& model, const model::HandIndex& hand);

/// Points of the skin where its bodies have these poses X_AB [m]: dual-quaternion blending (Kavan et al.
/// 2008, ACM TOG 27:105), with which skin beside a joint turns about the joint's centre.
std::vector<Vec3> posed(const Skin& skin, std::span<const Pose> bodies);

/// Outward unit normals at the points: of the faces about each, by area.
std::vector<Vec3> normals_of(const Skin& skin, const std::vector<Vec3>& points);

/// Skins of the hands, each made once: those of the last hands are kept.
std::vector<std::shared_ptr<const Skin>> skins_of(const model::Model& model);

/// Puts the skin on the hand's shapes in the list, each with the piece nearest to it, and takes its stump
/// off.
/// @param coloured fingers with the colours of their shapes
void put_on(const Skin& skin, const model::Model& model, const model::State& state, const Colour& tone,
            bool coloured, DrawList& list);

}  // namespace handsim::output
