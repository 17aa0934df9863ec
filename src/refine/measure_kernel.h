#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "brick/brick_tree.h"
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
/// A bit for every sample of a batch, the first one's the lowest.
using LaneBits = std::uint64_t;

/// Four numbers that are fetched at once, half a cache line.
struct alignas(32) FourDoubles {
    std::array<double, 4> number;
};

/// Stored samples at the corners of every sample's cell: row x | y << 1 holds those at z and z + 1 of each
/// lane.
struct alignas(64) LaneCorners {
    std::array<float, 2 * kMeasureLanes> row[4];
    float& at(std::size_t corner, std::size_t lane) { return row[corner & 3][2 * lane + (corner >> 2)]; }
};

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

/// Samples on their way, a lane each. Lanes from `count` on hold anything, but nodes of the mesh and no
/// volume.
struct alignas(64) MeasureBatch {
    std::array<std::int32_t, 4> tet[kMeasureLanes];  ///< of elements: their nodes
    FourDoubles node[4][kMeasureLanes];              ///< theirs, or a node as the first: place and a value
    LaneDoubles sixfold;                             ///< of elements: six times the volume, with its sign
    LaneDoubles volume;    ///< |volume|, world units; 0 for a lane that is no sample
    LaneDoubles place[3];  ///< from the tree's origin, world units
    LaneInts leaf;
    FourDoubles
        frame[kMeasureLanes];  ///< of the leaf: first point, in points of its level, and points a world unit
    LaneDoubles fraction[3];   ///< in the cell
    /// Of the cell: the tile and the offset there of the first corner, 1, 2 and 4 where the corners beyond it
    /// along x, y and z lie in other tiles, and its least index on any axis.
    LaneInts tile, offset, beyond, leastCell;
    Lanes<std::int64_t> corner;  ///< address of the first corner's value
    LaneBits kept;               ///< whose error is measured here
    int count;

    LaneBits lanes() const { return ~LaneBits(0) >> (kMeasureLanes - count); }
};

/// The elements of a batch whose volume is surely negative, and those whose sign double can't tell.
struct ElementSigns {
    LaneBits negative, uncertain;
};

/// The arithmetic of measuring a batch. Every operation is a single IEEE operation in a fixed order: the same
/// bits on every processor.
namespace measure {

/// Fetches the elements' nodes, and those of the lanes from count on.
void gatherNodes(MeasureBatch& batch, const FourDoubles* nodes);
/// Places from the tree's origin of samples that are nodes, and the nodes' values.
void placeNodes(MeasureBatch& batch, const Vec3d& originWorld, LaneDoubles& values);
/// Volumes, centroids from the tree's origin, and the means of the nodes' values. @param reference a place
/// near the mesh, see SampledMesh.
ElementSigns placeElements(MeasureBatch& batch, const Vec3d& reference, const Vec3d& originWorld,
                           LaneDoubles& values);
/// The leaves of the places inside `bounds`, which count from the tree's origin. Returns the lanes for which
/// there is one.
LaneBits findLeaves(MeasureBatch& batch, const BrickTree::Walk& walk, double inverseSpacing0,
                    const Box3d& bounds);
/// Cells and fractions in the leaves' frames, as locateInBrick. @param tilesPerEdge of the table of tiles.
void locateCells(MeasureBatch& batch, int brickCells, int tilesPerEdge);
/// Addresses of the first corners of cells of `lanes` that lie in one tile whose points can all be read
/// without a look at its coverage; returns those lanes. @param tiles of all leaves, `tilesPerLeaf` each: the
/// address of the tile's values, odd for other tiles.
LaneBits findCorners(MeasureBatch& batch, LaneBits lanes, const std::int64_t* tiles, int tilesPerLeaf);
/// Adds what a component contributes to the error of its field: |interpolated - exact|, of fields with
/// several components its square.
void addDifference(const MeasureBatch& batch, const LaneCorners& corners, const LaneDoubles& exact,
                   bool isSquared, LaneDoubles& sum);
/// Errors from those sums; lanes whose error isn't finite aren't kept any more.
void finishErrors(MeasureBatch& batch, bool isSquared, LaneDoubles& sum);
/// Errors in the field's unit as they are listed, -1 where not kept. Returns the largest error that is kept,
/// -1 when there is none.
double listErrors(const MeasureBatch& batch, const LaneDoubles& errors, double unit, LaneFloats& listed);
/// Adds squares of listed errors, those of negative ones and of NaN as 0; `share` times the volume is their
/// weight.
void addSquares(const MeasureBatch& batch, const LaneFloats& listed, double share, SquareSums& sums);
/// The same for the elements' nodes. @param listed errors of all nodes.
void addNodeSquares(const MeasureBatch& batch, const float* listed, double share, SquareSums& sums);
/// Adds volume times value, where that is finite.
void addIntegral(const MeasureBatch& batch, const LaneDoubles& values, LaneSums& sums);
/// Adds stored values, value i to the sum of i modulo 8. @param count a multiple of 8.
void addValues(const float* values, std::size_t count, LaneSums& sums);

}  // namespace measure

}  // namespace tessera
