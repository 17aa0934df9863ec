#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// What a BrickSampler samples, and by what.
struct SamplerOptions {
    /// A name that registry.h knows; "auto": what is predicted to be fastest here.
    std::string algorithm = "software";
    /// Names of fields; "point:T" and "cell:T" tell two of one name apart. Empty: all.
    std::vector<std::string> fields{};
};

/// Samples single bricks of a mesh, wherever and as fine as they are asked for. The first call builds an
/// index of the elements; from then on a brick costs what lies in it, not what the mesh holds. The mesh must
/// outlive it and stay unchanged. Several threads may sample at once.
class BrickSampler {
  public:
    /// Throws InputError for a mesh that doesn't fit together, a field that isn't there, or an algorithm that
    /// can't run here.
    explicit BrickSampler(const TetMesh& mesh, const SamplerOptions& options = {});
    explicit BrickSampler(TetMesh&&, const SamplerOptions& = {}) = delete;
    ~BrickSampler();

    /// A brick of edge^3 lattice points with the point nearest to `centreWorld` in its middle: point edge / 2
    /// along each axis. All bricks of one spacing lie on one lattice, which begins at the mesh's lower
    /// corner, so where two overlap their samples have the same bits. A sample's channels are the components
    /// of the fields, in the order of `SamplerOptions::fields`.
    /// @param spacingWorld between lattice points, world units, positive. @param edge 1 to 1024.
    /// Throws InputError for others, and for a place too far away to count lattice points to it; Cancelled.
    Block around(const Vec3d& centreWorld, double spacingWorld, int edge,
                 const Execution& execution = {}) const;

    /// Any box of any lattice: a layer of points for a cut plane, for example. Throws as above.
    Block sample(const Lattice& lattice, const IndexBox& box, const Execution& execution = {}) const;

  private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace tessera
