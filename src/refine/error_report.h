#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/vec.h"

namespace tessera {

/// How far trilinear reconstruction of one field is from the exact field, measured at every mesh node and at
/// the centroid of every element of non-zero volume (cell fields: centroids only). A vector's error is the
/// Euclidean norm of the difference.
struct FieldError {
    std::string name;
    int components = 1;
    std::string location;    ///< "point" or "cell"
    double range = 0;        ///< largest component range over the mesh; 0 for a constant field
    double max = 0;          ///< field units
    double p999 = 0;         ///< 99.9 % of the samples are at most this, field units
    double rms = 0;          ///< volume-weighted, field units
    double relativeMax = 0;  ///< max / range, 0 when the range is 0
    double relativeP999 = 0;
    double relativeRms = 0;
    Vec3d worstPlaceWorld{0};  ///< sample with the largest error
    std::int64_t samples = 0;
    std::int64_t skippedSamples = 0;   ///< the exact or the reconstructed value isn't finite
    std::int64_t validPoints = 0;      ///< stored points that are covered and finite
    std::vector<double> integralMesh;  ///< one a component: integral over the mesh (elements' |volume|)
    std::vector<double>
        integralLattice;  ///< one a component: sum of f h^3 over valid points, each point once
};

/// The error of a whole output, on the final tree with the seam rule.
struct ErrorReport {
    std::vector<FieldError> fields;
    double fullyCoveredShare = 0;  ///< share of samples whose cell has all eight corners in the mesh
    std::int64_t nodes = 0;        ///< samples at nodes
    std::int64_t centroids = 0;    ///< samples at centroids
    std::int64_t outsideBricks =
        0;  ///< samples in no brick (only when --bounds cuts the mesh); not part of any figure
    std::int64_t incomplete = 0;  ///< samples beside points that aren't stored, where no figure is measured
    std::int64_t coveredPoints = 0;
    std::int64_t flatElements = 0;  ///< zero volume
    std::int64_t invertedElements = 0;
};

}  // namespace tessera
