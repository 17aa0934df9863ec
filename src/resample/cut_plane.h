#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "mesh/plane_query.h"
#include "tessera/resampler.h"

// A free cut plane through a mesh: a lattice with one layer, after M. Weiler and T. Ertl, Hardware-Software-
// Balanced Resampling for the Interactive Visualization of Unstructured Grids, IEEE Visualization 2001,
// section 3.3. Only the elements that the plane can meet are resampled, and the samples have the same bits as
// those of the whole mesh on that lattice (but in the normalised sample formats, whose steps follow the range
// of the values that are there).

namespace tessera {

struct CutOptions {
    std::optional<Vec3d> originWorld;  ///< a point of the plane; not given: the centre of the mesh's bounds
    Vec3d normal{0, 0, 1};             ///< of any length but zero
    /// Its projection onto the plane points up in the picture. It turns the picture and never mirrors it. Not
    /// given: y when z is the normal's largest component, else z; the first axis (x, or y when x is the
    /// normal's largest component) then runs to the right, whichever way the normal points. So the axes are
    /// (x, y), (x, z) and (y, z) for normals along z, y and x.
    std::optional<Vec3d> up;
    /// Width and height of the picture, centred on the origin; not given: the cut's own extent.
    std::optional<std::array<double, 2>> sizeWorld;
    int resolution = 1024;  ///< pixels along the longer edge, 1 to kLargestCutResolution
    /// How far a resampler may cover beyond an element, in voxels: ResamplerInfo::spillBoundVoxels.
    double spillVoxels = 0x1p-8;
};
inline constexpr int kLargestCutResolution = 16384;

/// The pixels of a cut. Steps u, v and w point right, up and along the normal and have the length of a
/// pixel's edge; lattice point (x, height - 1 - y, 0) is the centre of pixel (x, y), y downwards.
struct CutFrame {
    Lattice lattice;
    int width = 0, height = 0;

    double spacingWorld() const { return glm::length(lattice.uWorld); }
};

/// Where a cut lies and what it cuts.
struct Cut {
    CutFrame frame;
    Vec3d originWorld{0};  ///< a point of the plane, as given
    Vec3d normal{0};       ///< of length 1
    PlaneHits hits;
};

/// Throws InputError for options that no mesh can be cut with: call it before long work.
void checkCutOptions(const CutOptions& options);

/// Throws InputError for such options and for a plane or picture that the mesh does not meet.
Cut planCut(const TetMesh& mesh, const PlaneQuery& query, const CutOptions& options);

/// Samples of a cut, row by row from the top left.
struct CutSamples {
    int width = 0, height = 0;
    std::vector<std::vector<float>> channels;  ///< width x height each: 0 outside the mesh, NaN where invalid
    std::vector<std::uint8_t> coverage;        ///< width x height: 1 where the pixel's centre is in the mesh
    std::string target;                        ///< the code path that sampled it
    ResampleStatistics statistics;
};

/// @param fields indices into mesh.fields: their components are the channels, in this order.
CutSamples sampleCut(const TetMesh& mesh, const Cut& cut, std::span<const int> fields,
                     const Resampler& resampler, const BindOptions& options, const Execution& execution);

}  // namespace tessera
