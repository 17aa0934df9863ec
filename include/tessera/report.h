#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tessera/vec.h"

namespace tessera {

/// How far trilinear reconstruction of one field is from the exact field, measured at every mesh node and at
/// the centroid of every element of non-zero volume (cell fields: centroids only). A vector's error is the
/// Euclidean norm of the difference.
struct FieldError {
    std::string name;
    int components = 1;
    /// "point" or "cell".
    std::string location;
    /// Largest component range over the mesh, field units; 0 for a constant field.
    double range = 0;
    /// Largest error, field units.
    double max = 0;
    /// 99.9 % of the samples' errors are at most this, field units.
    double p999 = 0;
    /// Root of the volume-weighted mean square, field units.
    double rms = 0;
    /// The same three as shares of the range; 0 when the range is 0.
    double relativeMax = 0;
    double relativeP999 = 0;
    double relativeRms = 0;
    /// Where the largest error is.
    Vec3d worstPlaceWorld{0};
    std::int64_t samples = 0;
    /// Samples where the exact or the reconstructed value isn't finite.
    std::int64_t skippedSamples = 0;
    /// Stored points that are covered and finite.
    std::int64_t validPoints = 0;
    /// One a component: integral over the mesh (elements' |volume|).
    std::vector<double> integralMesh;
    /// One a component: sum of f h^3 over valid points, each point once.
    std::vector<double> integralLattice;
};

/// The error of all fields, as reading the output with its rule at seams shows it.
struct ErrorReport {
    std::vector<FieldError> fields;
    /// Share of samples whose cell has all eight corners in the mesh.
    double fullyCoveredShare = 0;
    /// Samples at nodes.
    std::int64_t nodes = 0;
    /// Samples at centroids.
    std::int64_t centroids = 0;
    /// Samples in no brick (only when bounds cut the mesh); not part of any figure.
    std::int64_t outsideBricks = 0;
    /// Samples beside points that aren't stored, where no figure is measured.
    std::int64_t incomplete = 0;
    /// Stored points that lie in the mesh.
    std::int64_t coveredPoints = 0;
    /// Elements of zero volume.
    std::int64_t flatElements = 0;
    std::int64_t invertedElements = 0;
};

}  // namespace tessera
