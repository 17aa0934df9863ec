#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tessera/mesh.h"

namespace tessera {

inline constexpr int kMeasureLanes = 64;  ///< samples of a batch
inline constexpr int kSumLanes = 8;       ///< sums are kept so many at a time, whatever the processor has

/// A number of every sample of a batch.
template <class Number>
struct alignas(64) Lanes {
    Number lane[kMeasureLanes];
    Number& operator[](std::size_t i) { return lane[i]; }
    const Number& operator[](std::size_t i) const { return lane[i]; }
};
using LaneDoubles = Lanes<double>;
using LaneFloats = Lanes<float>;
using LaneInts = Lanes<std::int32_t>;

/// Eight sums side by side: sample i of a batch is added to that of i modulo 8, so that no addition waits for
/// the one before it and the result is the same for vectors of any length.
struct alignas(64) LaneSums {
    std::array<double, kSumLanes> lane{};
    double sum() const {
        return ((lane[0] + lane[1]) + (lane[2] + lane[3])) + ((lane[4] + lane[5]) + (lane[6] + lane[7]));
    }
};

/// Weighted squares of errors in units of the field's range.
struct SquareSums {
    LaneSums squares, weights;
};

/// Samples on their way, a lane each. Lanes from `count` on hold anything, and volume and isKept of 0.
struct alignas(64) MeasureBatch {
    // Of elements: their nodes' places (world units), six times their volume, and whether its sign is certain
    // (1, else 0).
    LaneDoubles nodeWorld[4][3];
    LaneDoubles sixfold, isCertain;
    LaneDoubles volume;       ///< |volume|, world units; 0 for a lane that is no sample
    LaneDoubles place[3];     ///< of the sample, from the tree's origin, world units
    LaneDoubles local[3];     ///< in its leaf's index space, from the leaf's first point
    LaneDoubles fraction[3];  ///< in its cell
    /// Of its cell: the tile and the offset there of the first corner, 1, 2 and 4 where the corners beyond it
    /// along x, y and z lie in other tiles, and its least index on any axis.
    LaneInts tile, offset, beyond, leastCell;
    LaneDoubles isKept;  ///< 1 where the error is measured here, else 0
    int count;
};

/// The arithmetic of measuring a batch. Every operation is a single IEEE operation in a fixed order: the same
/// bits on every processor.
namespace measure {

/// Volumes, and centroids from the tree's origin. @param reference a place near the mesh, see SampledMesh.
void placeElements(MeasureBatch& batch, const Vec3d& reference, const Vec3d& originWorld);
/// Cells and fractions from local places, as locateInBrick. @param tilesPerEdge of the table of tiles.
void locateCells(MeasureBatch& batch, int brickCells, int tilesPerEdge);
/// Adds what a component contributes to the error of its field: |interpolated - exact|, of fields with
/// several components its square.
void addDifference(const MeasureBatch& batch, const LaneFloats (&corners)[8], const LaneDoubles& exact,
                   bool isSquared, LaneDoubles& sum);
/// Errors from those sums; lanes whose error isn't finite aren't kept any more.
void finishErrors(MeasureBatch& batch, bool isSquared, LaneDoubles& sum);
/// Errors in the field's unit as they are listed, -1 where not kept. Returns the largest error that is kept,
/// -1 when there is none.
double listErrors(const MeasureBatch& batch, const LaneDoubles& errors, double unit, LaneFloats& listed);
/// Adds squares of listed errors, those of negative ones and of NaN as 0; `share` times the volume is their
/// weight.
void addSquares(const MeasureBatch& batch, const LaneFloats& listed, double share, SquareSums& sums);
/// Adds volume times value, where that is finite.
void addIntegral(const MeasureBatch& batch, const LaneDoubles& values, LaneSums& sums);

}  // namespace measure

}  // namespace tessera
