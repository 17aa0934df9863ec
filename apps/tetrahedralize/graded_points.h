#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace tessera {

/// "graded:150K" names a made input in place of a file: how many points; none for other names. Throws
/// InputError for a number out of range.
std::optional<std::int64_t> gradedPointCount(const std::string& input);

/// Writes a table of so many random points and the 8 corners of the unit cube, with one field,
/// sin(9x) cos(7y) + z^2. Points are close together in the middle (gradedPoints with power 2.2): the mesh
/// that speed is measured on, with 6.7 tetrahedra a point. Throws IoError.
void writeGradedPoints(const std::string& path, std::int64_t count);

}  // namespace tessera
