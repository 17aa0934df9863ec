#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "refine/error_samples.h"
#include "refine/refine_options.h"
#include "tessera/mesh.h"

namespace tessera {

/// The bound on one field, in field units. Fields that don't matter have none.
struct FieldBound {
    std::size_t field = 0;  ///< position among the chosen fields
    double bound = 0;
};

/// Whether the bound holds for a field of the mesh: those named, or all but the cell fields, whose largest
/// error never vanishes.
bool isBounded(const TetMesh& mesh, int field, const RefineOptions& options);

/// In field units. @param range of the field.
double boundOf(const RefineOptions& options, double range);

/// Throws InputError when no bound can hold.
std::vector<FieldBound> errorBounds(const TetMesh& mesh, std::span<const int> fields,
                                    const SampledMesh& samples, const RefineOptions& options);

}  // namespace tessera
