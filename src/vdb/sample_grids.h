#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace tessera {

/// A place to read a grid at.
struct GridPlace {
    std::array<double, 3> world;       ///< in the grid's own world, file units
    std::array<double, 3> exactIndex;  ///< where the grid's transform would place it if it were exact
};

/// A grid, and the list of places to read it at.
struct GridQuestion {
    std::string grid;
    int components = 1;      ///< 1 or 3
    std::size_t places = 0;  ///< which list
};

/// What OpenVDB's trilinear sampler says there.
struct GridReading {
    std::array<float, 3> value{};  ///< by the grid's transform
    std::array<float, 3>
        atExactIndex{};            ///< the same as `value` where the transform moves it by next to nothing
    std::uint64_t isComplete = 0;  ///< 1: all voxels around that have a weight are active; else 0
};

/// Reads each grid at its places, as a program does that knows nothing of Tessera. An answer is empty where
/// there is no such grid. Throws InputError where a grid holds other values.
std::vector<std::vector<GridReading>> sampleGrids(const std::string& path,
                                                  std::span<const std::vector<GridPlace>> places,
                                                  std::span<const GridQuestion> questions);
using GridSampler = std::function<decltype(sampleGrids)>;

}  // namespace tessera
