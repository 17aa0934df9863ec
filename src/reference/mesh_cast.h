#pragma once

#include "base/rgba_image.h"
#include "tessera/execution.h"
#include "tessera/focus.h"
#include "tessera/mesh.h"
#include "tessera/transfer_function.h"

namespace tessera {

/// What is drawn of a mesh.
struct MeshCastOptions {
    int field = 0;      ///< index into mesh.fields
    int component = 0;  ///< of the field
    TransferFunction function;
    /// A layer as thick as this has the opacity that the transfer function gives; world units, above 0.
    double layerWorld = 1;
};

/// Draws a field without sampling it: along each ray, cut with the elements, absorption plus emission (N.
/// Max, Optical Models for Direct Volume Rendering, 1995), the model of RayCaster and SliceRenderer with
/// steps of no length. With the colour C and the opacity a of the transfer function, -ln(1 - a) / layer of
/// the light is absorbed a world unit, and as much of C emitted; an opacity of 1 over a stretch of values
/// stops it all. Within an element the field is linear along the ray, and between two stops of the function C
/// and a are, too: there the absorption has a closed form, and the emission is integrated until it is within
/// 1e-6. So a colour or opacity is within 1e-5 of the integral, but for the rounding of doubles in needles of
/// elements.
///
/// Where elements overlap, the one in which a place lies deepest owns it, by the distance to the nearest of
/// its planes, of equals the one with the lowest index: the resamplers' rule without its steps. Of an element
/// that has a value which isn't finite in float nothing is drawn. The same for any number of threads.
///
/// Throws InputError for a camera that sees nothing, a transfer function that isn't one, and options out of
/// range.
RgbaImage castMesh(const TetMesh& mesh, const Camera& camera, const MeshCastOptions& options,
                   const Execution& execution);

}  // namespace tessera
