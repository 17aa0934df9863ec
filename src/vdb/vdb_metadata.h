#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "refine/brick_result.h"
#include "vdb/vdb_file.h"

namespace tessera {

inline constexpr int kVdbFormat = 1;  ///< raised when an older reader could no longer read the file

/// Throws InputError when two grids would get the same name, or a field the name of the coverage mask or of
/// the mesh's surface, where that stands beside them. Call it before long work.
void checkOutputFields(const std::vector<OutputField>& fields, bool hasSurface = false);

/// One value grid a level: a scalar, or the three components of a vector.
struct GridPlan {
    std::string name;    ///< without the level's suffix
    std::string field;   ///< OutputField::name
    int components = 1;  ///< 1 or 3
    int firstChannel = 0;
};

/// The value grids of some fields, in the order of the file: 1 and 3 components are one grid, others split
/// into F_0, F_1, ...
std::vector<GridPlan> planGrids(const std::vector<OutputField>& fields);
/// `base` in the flat layout, `base_level_l` in the levels layout.
std::string gridName(const std::string& base, VdbLayout layout, int level);
/// File units per world unit for a finest spacing. @param requested VdbWriteOptions::unitScale. Throws
/// InputError when the requested one gives voxels that OpenVDB refuses.
double chooseUnitScale(double finestSpacingWorld, double requested);

/// What the file says of itself. VdbFile without samples and grid list.
using VdbMetadata = VdbFile;

/// What a file says of some samples that are written to it, but for their statistics. @param unitScale file
/// units per world unit.
VdbMetadata describeFile(const std::vector<OutputField>& fields, const BrickResult& result,
                         const VdbWriteOptions& options, double unitScale);

/// Text entries of the file's metadata, by key.
std::map<std::string, std::string> encodeMetadata(const VdbMetadata& metadata);
/// Throws InputError when an entry is missing or damaged.
VdbMetadata decodeMetadata(const std::map<std::string, std::string>& entries);

}  // namespace tessera
