#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "vdb/sample_grids.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// What a program sees that reads a file's grids by OpenVDB's trilinear sampler and knows nothing of Tessera.
struct OutsideReading {
    std::int64_t places = 0;       ///< nodes and centroids read
    std::int64_t incomplete = 0;   ///< of these, beside inactive voxels that should have a value
    std::vector<double> max;       ///< by field: largest difference to the exact field; Euclidean norm
    std::vector<double> rounding;  ///< by field: most that the rounding of the file's transforms changes
    std::string firstProblem;      ///< a place that is incomplete
};

/// Reads the grids at every node and centroid of the mesh inside the file's bounds: of a flat file at all,
/// of the levels at those whose cell lies inside one brick. Places without a finite value don't count.
/// @param file what readVdb gave for `path`. @param fields indices into mesh.fields, as the file's fields.
/// @param sampler sampleGrids, here or elsewhere.
OutsideReading readAsOutsider(const std::string& path, const VdbFile& file, const TetMesh& mesh,
                              std::span<const int> fields, const GridSampler& sampler,
                              const Execution& execution);

}  // namespace tessera
