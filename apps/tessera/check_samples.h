#pragma once

#include <cstdint>
#include <string>

#include "io/vdb_file.h"
#include "mesh/tet_mesh.h"
#include "resample/resampler.h"

namespace tessera {

/// How stored voxels compare with the mesh, point by point.
struct SampleCheck {
    std::int64_t points = 0;       ///< lattice points looked at
    std::int64_t covered = 0;      ///< of these, stored as covered
    std::int64_t holes = 0;        ///< well inside an element, yet not covered
    std::int64_t spills = 0;       ///< covered, yet further from every element than the algorithm's bound
    std::int64_t wrongValues = 0;  ///< values that no element there explains
    double largestExcess = 0;      ///< worst of these: distance beyond what is allowed, field units
    std::string firstProblem;      ///< one sentence; empty when there is none
    bool good() const { return holes == 0 && spills == 0 && wrongValues == 0; }
};

/// Looks at about `samples` stored lattice points, evenly spread over the store, and evaluates the mesh there
/// directly in double: a search for the elements around the point and barycentric interpolation, which shares
/// no code with the resampler.
/// @param fields index into mesh.fields for each of file.fields.
SampleCheck checkSamples(const TetMesh& mesh, std::span<const int> fields, const VdbFile& file,
                         const Resampler& resampler, bool halfFloat, std::int64_t samples,
                         const Execution& execution);

}  // namespace tessera
