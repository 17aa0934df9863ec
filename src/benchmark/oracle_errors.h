#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "reference/reference_block.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

/// What a figure of errors is made of: shares of the field's range.
struct ErrorFigures {
    double max = 0, p999 = 0, rms = 0;
    std::int64_t count = 0;
};
/// @param errors none below 0; empty: all figures are 0.
ErrorFigures figuresOf(std::vector<double> errors);

/// How far a resampler's samples are from exact interpolation, which has nothing to do with the spacing, and
/// what it covers.
struct OracleFigures {
    ErrorFigures error;         ///< at the places that it covers
    std::int64_t holes = 0;     ///< lattice points in the mesh that it doesn't cover
    std::int64_t spills = 0;    ///< points that it covers further than the allowance from every element
    std::vector<float> values;  ///< by place, component by component; NaN where not covered
};

struct OracleOptions {
    int places = 1000;
    int lattices = 4;
    std::uint64_t seed = 1;
    /// Points further than this from every element count as spilt; voxels. The largest bound of the
    /// algorithms that keep the contract.
    double spillVoxels = 0x1p-8;
};

/// Random places in a mesh with the field's exact values there, by rational arithmetic. The places are points
/// of lattices with a random corner and spacing, chosen at random among those that lie in the mesh, exactly.
class OraclePlaces {
  public:
    /// @param field finite values only count. The mesh must outlive it. Throws InputError when no lattice
    /// point lies in the mesh.
    OraclePlaces(const TetMesh& mesh, int field, const OracleOptions& options, const Execution& execution);

    std::size_t count() const { return places_.size(); }
    std::size_t latticeCount() const { return grids_.size(); }
    /// Samples all lattices.
    OracleFigures measure(const Resampler& resampler, const BindOptions& bind,
                          const Execution& execution) const;
    /// A line a place: its lattice, index, corner and spacing of the lattice, and the exact value (the first
    /// component; all digits of a double), and what each of these had.
    std::string csv(const std::vector<std::string>& names, const std::vector<OracleFigures>& figures) const;

  private:
    struct Grid {
        Lattice lattice;
        ReferenceBlock reference;
    };
    struct Place {
        std::size_t grid = 0;
        Vec3i index{0};
        /// Component by component; of a cell field one for each element there.
        std::vector<std::vector<double>> values;
    };
    double errorAt(const Place& place, std::span<const float> values) const;

    const TetMesh& mesh_;
    int field_;
    double range_ = 0;
    std::vector<Grid> grids_;
    std::vector<Place> places_;
};

}  // namespace tessera
