#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "tessera/resampler.h"
#include "verify/point_checker.h"

namespace tessera {

/// What a file holds, as read back.
struct StoredVoxels {
    const BrickTree* tree = nullptr;    ///< of the store: the bricks, or a flat grid's of one level
    BrickStore* store = nullptr;        ///< samples and extension
    const BrickTree* bricks = nullptr;  ///< flat: what the grid was made of; else null
    int flatLevel = 0;                  ///< flat: the grid's level among them
    std::optional<Box3d> boundsWorld;
    int layers = 0;  ///< of the extension
    SampleBounds bounds;
};

/// How stored voxels measure against the mesh, all of them.
struct VoxelCheck {
    PointCheck samples;               ///< samples of the mesh, clauses 1 to 4
    std::int64_t derived = 0;         ///< extension, and flat voxels between samples: worked out anew
    std::int64_t wrongDerived = 0;    ///< of these, those that differ
    std::int64_t missingDerived = 0;  ///< of the extension, those that aren't there
    std::int64_t unexpected = 0;      ///< extension voxels that shouldn't be there
    std::string firstProblem;         ///< one sentence; empty when there is none

    bool isGood() const { return samples.isGood() && wrongDerived + missingDerived + unexpected == 0; }
};

/// Checks every stored voxel: coverage and samples against the mesh, in double and without the resampler's
/// code; extension and interpolated voxels against the reconstruction, worked out anew from the stored
/// samples. The store is as before when it returns.
/// @param fields indices into mesh.fields: the store's channels. @param resampler what the samples were made
/// by; only samples beyond the bounds, which a flat grid was interpolated from and doesn't hold, come from
/// it.
VoxelCheck checkVoxels(const TetMesh& mesh, std::span<const int> fields, const StoredVoxels& stored,
                       const Resampler& resampler, const BindOptions& bind, const Execution& execution);

}  // namespace tessera
