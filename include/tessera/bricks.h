#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"
#include "tessera/options.h"
#include "tessera/read.h"
#include "tessera/report.h"
#include "tessera/statistics.h"

namespace tessera {

/// One brick: cells of one spacing over a box.
struct Brick {
    /// 0 is the finest; each further level has twice the spacing.
    int level = 0;
    double spacingWorld = 0;
    /// World units, `BrickOptions::brickCells` times the spacing along each axis.
    Box3d boundsWorld;
};

/// A field that was sampled, and its channels: one for each component, from `firstChannel` on.
struct BrickField {
    std::string name;
    FieldLocation location = FieldLocation::point;
    int components = 1;
    int firstChannel = 0;
};

/// The samples of a mesh in bricks of several levels, with their measured error and what they were made of.
/// The mesh must outlive them, unchanged and where it is. A copy has samples of its own. Several threads may
/// read at once.
class Bricks {
  public:
    Bricks(const Bricks& other);
    Bricks(Bricks&& other) noexcept;
    Bricks& operator=(Bricks other) noexcept;
    ~Bricks();

    /// What they were made by: "auto" replaced by the algorithm that was taken, and all fields by name.
    const BrickOptions& options() const;
    /// The lattice, for other results on the same one.
    FixedFrame frame() const;
    const std::vector<BrickField>& fields() const;

    /// The error of reading the bricks, against the mesh.
    const ErrorReport& report() const;
    /// Criterion::error: the largest errors, with Criterion::visibility those that are seen, are within the
    /// bound. Else true.
    bool isWithinBound() const;
    /// What ended the refinement before the bound was reached; empty when it was.
    const std::string& stoppedBecause() const;
    /// What a user should know, a sentence each: such as a spacing coarsened to keep a bound on memory.
    const std::vector<std::string>& notes() const;
    const ResampleStatistics& statistics() const;

    std::size_t count() const;
    /// @param index in [0, count()), ascending by level.
    Brick brick(std::size_t index) const;
    /// The samples of one brick: those of its brickCells^3 lattice points, without those of its upper faces.
    Block samples(std::size_t index) const;

    /// The channel of a field's component. Throws InputError when there is none.
    int channel(const std::string& field, int component = 0) const;
    /// The value at a place, world units, interpolated as readers of the file do it: trilinearly, and without
    /// jumps between levels. Nothing outside all bricks; outside the mesh, within a brick, a value that
    /// follows from the nearest ones in the mesh.
    std::optional<double> value(const Vec3d& placeWorld, int channel) const;

    struct Parts;
    explicit Bricks(std::unique_ptr<Parts> parts);
    const Parts& parts() const { return *parts_; }
    Parts& parts() { return *parts_; }

  private:
    std::unique_ptr<Parts> parts_;
};

/// Samples a mesh: plans bricks by the criterion, samples them and measures the error. The same bits for any
/// number of threads. Throws InputError for options that don't fit together, a field that isn't there, an
/// algorithm that can't run here, or bounds that nothing fits into; Cancelled.
Bricks resample(const TetMesh& mesh, const BrickOptions& options = {}, const Execution& execution = {});
/// The same, and what is written then names the file and time that the mesh is from.
Bricks resample(const InputMesh& input, const BrickOptions& options = {}, const Execution& execution = {});

/// Bricks refer to their mesh: it must have a name of its own.
Bricks resample(TetMesh&&, const BrickOptions& = {}, const Execution& = {}) = delete;
Bricks resample(InputMesh&&, const BrickOptions& = {}, const Execution& = {}) = delete;

}  // namespace tessera
