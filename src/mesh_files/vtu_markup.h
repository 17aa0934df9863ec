#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "files/input_file.h"
#include "tessera/mesh.h"

namespace tessera {

/// An array of a .vtu file whose values are appended.
struct VtuArray {
    std::string name, type;
    FieldLocation location = FieldLocation::point;
    int components = 1;
    std::size_t offset = 0;  ///< behind VtuMarkup::appendedAt
};

/// What the markup of a .vtu file of the plainest form says.
struct VtuMarkup {
    std::int64_t points = 0, cells = 0;  ///< 1 at least
    std::vector<VtuArray> fields;        ///< of points, then of cells, each in the file's order
    VtuArray coordinates, connectivity, offsets, types;
    std::size_t headerBytes = 4;  ///< of the sizes in front of values
    bool compressed = false;      ///< by zlib
    std::size_t appendedAt = 0, appendedEnd = 0;
};

/// Reads markup that every parser reads alike: one piece, elements and attributes that are known, each once,
/// plain names of fields that differ, values appended as raw bytes of little-endian numbers. Nothing for any
/// other, damaged or not.
std::optional<VtuMarkup> parsePlainVtu(InputFile& file);

}  // namespace tessera
