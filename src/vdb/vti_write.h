#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "refine/brick_result.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// Points of the largest image that is written unless VdbWriteOptions::maxVoxels allows more.
inline constexpr std::int64_t kDefaultImagePoints = std::int64_t(1) << 29;

/// Throws InputError for options that a VTK image can't follow: half floats, a turned axis.
void checkVtiOptions(const VdbWriteOptions& options);

/// Writes a flat grid as VTK image data (.vti) over the box of its active voxels and one layer of points
/// around it: every lattice point is a point of the image, at the same place. Point data are one array of
/// 32-bit floats a field, with all its components, and as VTK's own filters that resample write them,
/// `vtkValidPointMask`, 1 for points in the mesh, and `vtkGhostType`, which hides the points that nothing is
/// stored for, as it does the cells beside them. Hidden points hold VdbWriteOptions::hiddenValue, or else the
/// stored value that is closest to 0, so that all of an array has the range of what is stored; a value in the
/// mesh that isn't finite makes all components of its point NaN. Field data are the tessera_* entries of
/// docs/vdb_layout.md but for the table of bricks and the background, and `TimeValue` where the time is
/// known.
///
/// Nothing stands at `path` until the file is whole. Throws IoError (not writable, disk full), InputError (no
/// voxel, a box of too many points, names that clash), Cancelled. The same bytes for any number of threads.
VdbWriteResult writeVti(const std::string& path, const std::vector<OutputField>& fields, BrickResult& result,
                        const VdbWriteOptions& options, const Execution& execution);

}  // namespace tessera
