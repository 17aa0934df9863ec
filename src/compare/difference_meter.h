#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// How two algorithms' values of one field differ at the points that both cover. A vector's difference is its
/// Euclidean norm, its range the largest of its components' (as in the error report).
struct FieldDifference {
    std::string name;
    /// Values of cell fields jump between elements: where a point lies on a shared face, either is right.
    FieldLocation location = FieldLocation::point;
    double range = 0;
    std::int64_t points = 0;           ///< where both values are finite
    std::int64_t validityDiffers = 0;  ///< points where only one of the two is finite
    double max = 0;
    double p999 = 0;  ///< 99.9 % of the points differ by no more; known within 0.05 %, never too small
    double rms = 0;
    Vec3i worst{0};                 ///< lattice point of the maximum, the first in order of boxes and offsets
    double maxInThickElements = 0;  ///< over points that aren't near a thin element
    std::int64_t thinPoints = 0;    ///< points that are
};

/// Gathers the differences of two algorithms box by box, in constant memory.
class DifferenceMeter {
  public:
    /// @param fields what the blocks were sampled with.
    /// @param thinVoxels elements of less thickness count as thin.
    DifferenceMeter(const TetMesh& mesh, std::span<const int> fields, double thinVoxels);

    /// @param thinnestVoxels by offset in the box, as PointChecker gives it; empty: none is thin.
    void add(const Block& first, const Block& second, std::span<const float> thinnestVoxels);
    /// One a field.
    std::vector<FieldDifference> differences() const;

  private:
    struct Gathered {
        FieldDifference difference;
        int firstChannel = 0, channels = 0;
        double sumOfSquares = 0;
        std::vector<std::int64_t> counts;  // by the leading bits of the difference as a float
    };
    void addField(Gathered& field, const Block& first, const Block& second,
                  std::span<const float> thinnestVoxels) const;

    std::vector<Gathered> fields_;
    double thinVoxels_;
};

}  // namespace tessera
