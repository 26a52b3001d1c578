#include "handsim/hand/pieces.h"

#include <algorithm>
#include <cmath>

#include "handsim/model/shape_union.h"

namespace handsim::hand {

namespace {

using model::MassProperties;
using model::Shape;
using model::ShapeKind;

/// Length of a segment's cylinder within the matter of its parent, which its axis leaves at a 64th of the
/// segment: through a flat face, or a round end.
double shared_with(const Piece& parent, const Piece& piece) {
  constexpr int kSteps = 64;
  const Shape& capsule = piece.shapes[0];
  const double step = capsule.length / kSteps;
  double reach = capsule.length;
  bool flat = false;
  for (int i = 0; i < kSteps; ++i) {
    const Vec3 at = parent.frame.inverse() * (piece.frame * Vec3(0, (i + 0.5) * step, 0));
    bool in_box = false;
    const bool inside = std::ranges::any_of(parent.solids(), [&](const Shape& shape) {
      Vec3 local = shape.pose.inverse() * at;
      if (shape.kind == ShapeKind::box) {
        in_box = (local.cwiseAbs() - 0.5 * shape.edges).maxCoeff() < 0;
        return in_box;
      }
      local.z() -= std::clamp(local.z(), -0.5 * shape.length, 0.5 * shape.length);
      return local.norm() < shape.radius;
    });
    if (!inside) {
      reach = i * step;
      break;
    }
    flat = in_box;
  }
  return std::min(flat ? reach : covered(reach, capsule.radius), 0.95 * capsule.length);
}

/// The first part of a segment's cylinder, in its parent's frame, to be taken from the parent.
MassProperties taken_from(const Piece& parent, const Piece& piece, double length) {
  const double r = piece.shapes[0].radius, volume = M_PI * r * r * length;
  const double across = length * length / 12 + r * r / 4;
  const Pose frame = parent.frame.inverse() * piece.frame;
  const Mat3 axes = frame.q.toRotationMatrix();
  return {-volume, frame * Vec3(0, 0.5 * length, 0),
          -volume * axes * Vec3(across, r * r / 2, across).asDiagonal() * axes.transpose()};
}

/// Space that two rows share at zero angles counts once: a plane through the joint divides them. Of a parent
/// that is one box, or goes on beyond the joint, the segment begins where it leaves it.
void share_space(std::vector<Piece>& parts, const HandSpec& spec) {
  for (std::size_t i = 1; i <= spec.segments.size(); ++i) {
    // A carrier has no shape: its segment starts where it does, in its parent. The palm's are in the palm.
    std::optional<std::size_t> row = spec.segments[i - 1].parent;
    while (row && (spec.segments[*row].carrier || !spec.segments[*row].of_palm.empty()))
      row = spec.segments[*row].parent;
    Piece& own = parts[i];
    if (own.shapes.size() != 1) continue;
    const Shape& capsule = own.shapes[0];
    Piece& parent = parts[row ? *row + 1 : 0];
    const Vec3 at = parent.frame.inverse() * own.frame.p;
    if (parent.cut && (at - Vec3(0, parent.shapes[0].length, 0)).norm() < 1e-9) {
      parent.cut->flat_end = true;
      own.cut = Cut{-bulge(parent.shapes[0].radius, capsule.radius), false};
      continue;
    }
    const double shared = shared_with(parent, own);
    own.cut = Cut{parent.together ? 0 : shared, false};
    if (!parent.together) continue;
    const MassProperties taken = taken_from(parent, own, shared);
    parent.together = model::joined({*parent.together, taken});
    own.taken = taken;
  }
}

/// Volume of a part's matter [m^3]; a carrier takes its share of the segment after it.
double volume_of(const std::vector<Piece>& parts, std::size_t i) {
  const Piece& part = parts[i];
  if (!part.of_palm.empty()) return 0;
  if (part.shapes.empty()) return kCarrierShare / (1 - kCarrierShare) * volume_of(parts, i + 1);
  const bool carried = i > 0 && parts[i - 1].shapes.empty() && parts[i - 1].of_palm.empty();
  const double own = part.cut        ? matter(part.shapes[0], *part.cut).volume
                     : part.together ? part.together->mass
                                     : model::volume(part.shapes[0]);
  return carried ? (1 - kCarrierShare) * own : own;
}

/// Masses by share of the hand. Without a share the palm gets the remainder, so that all sum to the hand.
void set_masses_by_share(std::vector<Piece>& parts, BuiltHand& hand, const HandSpec& spec,
                         const Person& person) {
  double sum = spec.palm.mass_share.value_or(0);
  for (const SegmentSpec& row : spec.segments) sum += row.mass_share;
  double whole = share_of(spec.mass, person.sex) * person.mass;
  if (person.hand_mass) whole = spec.palm.mass_share ? *person.hand_mass / sum : *person.hand_mass;
  double rest = whole;
  for (std::size_t i = 0; i < spec.segments.size(); ++i) {
    parts[i + 1].mass = spec.segments[i].mass_share * whole;
    rest -= parts[i + 1].mass;
  }
  parts[0].mass = spec.palm.mass_share ? *spec.palm.mass_share * whole : rest;
  hand.mass = person.hand_mass.value_or(spec.palm.mass_share ? sum * whole : whole);
}

/// Masses by volume; a measured hand mass scales them.
void set_masses_by_volume(std::vector<Piece>& parts, BuiltHand& hand, const HandSpec& spec,
                          const Person& person) {
  std::vector<double> volumes;
  double total = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    volumes.push_back(volume_of(parts, i));
    total += volumes.back();
  }
  hand.mass = person.hand_mass.value_or(spec.mass.density * total);
  for (std::size_t i = 0; i < parts.size(); ++i) parts[i].mass = hand.mass * volumes[i] / total;
}

/// The part of a segment within the palm, which the palm lacks for it, in the palm's frame.
MassProperties given_to(const Piece& palm, const Piece& segment) {
  return taken_from(palm, segment, shared_with(palm, segment));
}

MassProperties negative(MassProperties of) {
  of.mass = -of.mass;
  of.inertia = -of.inertia;
  return of;
}

/// Gives the parts of the palm their shapes, and of its mass what it would lack without them: what they
/// share with the rest of it stays there. The sum of both is the palm, to rounding.
void split_palm(std::vector<Piece>& parts, const HandSpec& spec) {
  Piece& palm = parts[0];
  for (std::size_t i = 1; i < parts.size(); ++i) {
    Piece& own = parts[i];
    if (own.of_palm.empty()) continue;
    const auto stays = [&](const Shape& shape) {
      return std::ranges::find(own.of_palm, shape.name) == own.of_palm.end();
    };
    const Piece whole = palm;
    const auto move = [&](std::vector<Shape> Piece::*of) {
      std::vector<Shape>& left = palm.*of;
      const auto moved = std::stable_partition(left.begin(), left.end(), stays);
      (own.*of).assign(moved, left.end());
      left.erase(moved, left.end());
    };
    move(&Piece::shapes);
    move(&Piece::matter);
    std::vector<MassProperties> volumes = {model::union_properties(whole.solids()),
                                           negative(model::union_properties(palm.solids()))};
    for (std::size_t k = i + 1; k <= spec.segments.size(); ++k)
      if (spec.segments[k - 1].parent == i - 1 && parts[k].taken) volumes.push_back(*parts[k].taken);
    // A segment that carries these shapes has its own part of them already: what the palm gave it there.
    if (const Piece& carrier = parts[own.row + 1]; i > spec.segments.size() && carrier.taken) {
      volumes.push_back(given_to(whole, carrier));
      volumes.push_back(negative(given_to(palm, carrier)));
    }
    MassProperties volume = model::joined(volumes);
    own.mass = palm.mass * volume.mass / palm.together->mass;
    palm.mass -= own.mass;
    palm.together = model::joined({*palm.together, negative(volume)});
    // From the palm's frame, which is the hand's, to its own.
    const Pose frame = own.frame.inverse();
    const Mat3 axes = frame.q.toRotationMatrix();
    own.together =
        MassProperties{volume.mass, frame * volume.centre, axes * volume.inertia * axes.transpose()};
    for (Shape& shape : own.shapes) {
      shape.name = own.name + shape.name.substr(std::string("palm").size());
      // A pad that a segment carries beside its own shapes is still skin of the palm.
      if (i <= spec.segments.size()) shape.part = spec.segments[own.row].part;
      shape.pose = frame * shape.pose;
    }
  }
}

}  // namespace

void set_masses(std::vector<Piece>& parts, BuiltHand& hand, const HandSpec& spec, const Person& person) {
  if (spec.mass.kind == MassRule::Kind::tissue_density) share_space(parts, spec);
  if (spec.mass.kind == MassRule::Kind::body_mass_share)
    set_masses_by_share(parts, hand, spec, person);
  else
    set_masses_by_volume(parts, hand, spec, person);
  split_palm(parts, spec);
  hand.palm_volume = volume_of(parts, 0);
  for (std::size_t i = 1; i <= spec.segments.size(); ++i)
    if (!parts[i].of_palm.empty()) hand.palm_parts.push_back(parts[i].body);
}

}  // namespace handsim::hand
