#pragma once

#include <span>

#include "tessera/vec.h"

namespace tessera {

inline constexpr int kNodeBatch = 64;  ///< places that are split in one call, at most

/// Places in index space of an axis-parallel lattice, whole + part in about [0, 1), axis by axis.
struct SplitPlaces {
    alignas(64) double whole[3 * kNodeBatch], part[3 * kNodeBatch];
};

/// @param spacingWorld along each axis. The absolute error of a part is at most 4 * 2^-53.
void splitPlaces(std::span<const Vec3d> placesWorld, const Vec3d& originWorld, const Vec3d& spacingWorld,
                 SplitPlaces& split);

}  // namespace tessera
