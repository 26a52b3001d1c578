// Parts of a Model from those of a scene's file, one function for each: for the plans of grasps, which close
// a hand on an object before the scene is whole, and for the scene.
#pragma once

#include "handsim/model/validate.h"
#include "handsim/scene/read/contact_groups.h"

namespace handsim::scene {

/// Adds an object of a scene with its shapes in a group. @returns its body
int add_object(model::Model& model, const ObjectSpec& object, int group);

/// Adds the ground's plane in a group of its own. @returns the group
int add_ground(model::Model& model, const GroundSpec& ground);

/// Adds a body of the mechanism, with its shape, if it has one, in a group.
void add_body(model::Model& model, const BodySpec& spec, int group);

/// Adds a joint between bodies that are there, at their poses. A second joint to a child closes a loop.
void add_joint(model::Model& model, const MechanismJointSpec& spec);

/// Adds the rules of the contacts block (the last for a pair applies), or one for every pair, as far as their
/// effects are wanted. @param origins gets their places, unless null
void add_contact_rules(model::Model& model, const ContactsSpec& contacts, const ContactGroups& groups,
                       const model::Effects& wanted, model::Origins* origins);

}  // namespace handsim::scene
