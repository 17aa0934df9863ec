#pragma once

#include <optional>
#include <span>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "brick/seams.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "tessera/report.h"

namespace tessera {

class SampledMesh;

struct MeasureOptions {
    /// Samples outside this box are counted, not measured: the box that the tree was made for.
    std::optional<Box3d> boundsWorld;
    /// What a corner outside the mesh takes that the store's extension has no value for.
    Outside outside = Outside::nearest;
    /// When not null: the same mesh and fields, described for an earlier measurement.
    const SampledMesh* samples = nullptr;
    /// When not null: receives the largest relative error of any field in each leaf (drives refinement),
    /// leafCount entries.
    std::vector<double>* leafErrors = nullptr;
};

/// Measures trilinear reconstruction against the exact field. A lattice corner outside the mesh takes the
/// extension's value, or that at the nearest mesh point; across a change of level the border is interpolated
/// from the coarse brick (docs/algorithms.md, Seams). The volume-weighted RMS takes each element by the
/// quadrature that is exact for quadratics: a node weighs |volume| / 20, the centroid 4 |volume| / 5 (cell
/// fields: the centroid |volume|). The same for any number of threads.
/// @param fields indices into mesh.fields whose components are the store's channels, in this order.
ErrorReport measureError(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                         const BrickStore& store, const NearestOnDemand& nearest, const Execution& execution,
                         const MeasureOptions& options = {});

}  // namespace tessera
