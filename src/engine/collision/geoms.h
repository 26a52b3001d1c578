// Shapes of a Model as ODE geoms.
#pragma once

#include <ode/ode.h>

#include "handsim/engine/collision/ode_library.h"
#include "handsim/model/model.h"

namespace handsim::engine {

/// Creates the geom of a shape, its index as user data, at the origin.
/// @throws OdeFault
dGeomID make_geom(dSpaceID space, const model::Shape& shape, std::size_t index);

/// Fixes a geom to the ODE body of its shape. Planes cannot be.
void fix_geom(dGeomID geom, const model::Shape& shape, dBodyID body);

/// Puts a geom that is fixed to nothing where its shape is at a pose of its body.
void place_geom(dGeomID geom, const model::Shape& shape, const Pose& x_WB);
/// The same at a pose of the shape itself.
void place_shape(dGeomID geom, const model::Shape& shape, const Pose& x_WS);

inline std::size_t shape_index(dGeomID geom) { return reinterpret_cast<std::size_t>(dGeomGetData(geom)); }

}  // namespace handsim::engine
