#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tessera/focus.h"
#include "tessera/transfer_function.h"
#include "tessera/vec.h"

namespace tessera {

/// What decides how fine bricks are.
enum class Criterion : unsigned {
    /// One spacing everywhere: `resolution` or `spacingWorld`. Not with others.
    uniform = 1,
    /// `samplesPerElement` along the edges of the elements that are there.
    elementSize = 2,
    /// Bricks are halved until the measured error is within `maxError`.
    error = 4,
    /// The finest spacing around the places of `focus`, coarser with the distance from them.
    focus = 8,
    /// Only where the transfer function shows what differs. Beside others: errors then count only where they
    /// can be seen, and bricks without a value that is seen stay coarse.
    visibility = 16
};

/// One criterion, or several combined by |: bricks are then as fine as the one that wishes for the finest.
class Criteria {
  public:
    constexpr Criteria(Criterion criterion) : bits_(unsigned(criterion)) {}
    constexpr bool has(Criterion criterion) const { return (bits_ & unsigned(criterion)) != 0; }
    constexpr Criteria without(Criterion criterion) const {
        Criteria others = *this;
        others.bits_ &= ~unsigned(criterion);
        return others;
    }
    constexpr bool isOnly(Criterion criterion) const { return bits_ == unsigned(criterion); }
    friend constexpr Criteria operator|(Criteria a, Criteria b) {
        a.bits_ |= b.bits_;
        return a;
    }

  private:
    unsigned bits_;
};
constexpr Criteria operator|(Criterion a, Criterion b) {
    return Criteria(a) | Criteria(b);
}
/// Words separated by commas: "uniform", "element-size", "error", "focus",
/// "visibility".
std::string nameOf(Criteria criteria);

/// Which error a bound holds for: the largest of all, or the root of the mean square over the mesh's volume.
enum class ErrorMeasure { max, rms };

/// A lattice that bricks must lie on: that of another result, or of the first step of a time series.
struct FixedFrame {
    /// The place of lattice point (0, 0, 0), world units.
    Vec3d originWorld{0};
    /// Of level 0, the finest, world units.
    double spacingWorld = 1;
};

/// What to make of a mesh.
struct BrickOptions {
    /// A name that registry.h knows; "auto": what is predicted to be fastest here.
    std::string algorithm = "software";
    /// Of an algorithm with several: one of Resampler::targets(); empty: the first.
    std::string target{};
    /// Names of fields; "point:T" and "cell:T" tell two of one name apart. Empty: all.
    std::vector<std::string> fields{};

    Criteria criterion = Criterion::elementSize;
    /// The finest spacing as a number of lattice points along the longest axis of the bounds, at least 2; 0:
    /// not given. Around a focus it is then that of 256 points.
    int resolution = 0;
    /// The finest spacing, world units; 0: not given. Not beside `resolution`.
    double spacingWorld = 0;
    /// elementSize: lattice points along a typical element edge.
    double samplesPerElement = 2;
    /// Nested levels at most; 0: 8 for elementSize, no bound for error.
    int maxLevels = 0;

    /// error: the bound, as a share of each field's range or in the field's unit.
    double maxError = 0;
    bool maxErrorIsRelative = true;
    ErrorMeasure errorMeasure = ErrorMeasure::max;
    /// Names of the fields that the bound holds for; empty: all point fields chosen.
    std::vector<std::string> errorFields{};

    /// focus: where bricks are to be fine, one place at least.
    std::vector<Focus> focus{};

    /// visibility: what is seen of one of the fields.
    std::optional<TransferFunction> transferFunction{};

    /// Cells along a brick's edge: 8, 16, 32 or 64.
    int brickCells = 16;
    /// Bound on stored points; 0: one from the memory there is.
    std::int64_t maxVoxels = 0;
    /// Bound on the samples' memory, bytes; 0: none of its own.
    std::int64_t maxMemoryBytes = 0;
    /// Keeps only the points that reading inside this box needs, world units.
    std::optional<Box3d> boundsWorld{};
    /// In place of `resolution` and `spacingWorld`.
    std::optional<FixedFrame> frame{};
};

}  // namespace tessera
