#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mesh_files/raw_mesh.h"
#include "surface/surface.h"

namespace tessera {

inline constexpr const char* kStlFormat = "STL";
inline constexpr const char* kPolyFormat = "TetGen surface";

/// A surface as its file has it, with polygons of any number of corners.
struct RawSurface {
    std::string format;
    std::vector<Vec3d> points;
    std::vector<Field> fields;          ///< of points, or of polygons (FieldLocation::cell)
    std::vector<std::int32_t> corners;  ///< point indices of all polygons, one behind the other
    std::vector<std::int64_t> ends;     ///< in `corners`, of every polygon
    std::vector<Vec3d> holesWorld;
    std::vector<RegionSeed> regions;
    std::vector<std::string> warnings;

    std::int64_t polygonCount() const { return std::int64_t(ends.size()); }
    std::span<const std::int32_t> polygon(std::int64_t p) const {
        const std::int64_t begin = p == 0 ? 0 : ends[std::size_t(p - 1)];
        return std::span(corners).subspan(std::size_t(begin), std::size_t(ends[std::size_t(p)] - begin));
    }
    void endPolygon() { ends.push_back(std::int64_t(corners.size())); }
};

}  // namespace tessera
