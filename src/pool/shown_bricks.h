#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "brick/seams.h"
#include "pool/brick_index.h"
#include "schedule/brick_target.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// The values of some points, point by point: channels() each. Beside each point whether it is covered: a
/// sample there is, or the seam rule interpolates between samples that are. And how far it is from the mesh's
/// surface, by the seam rule as values are: at cells that the surface runs through a signed distance
/// (SurfacePoints), elsewhere as far as there is.
struct PointValues {
    std::vector<double> values;  ///< NaN where a value isn't finite
    std::vector<std::uint8_t> covered;
    std::vector<float> surface;  ///< voxels of the leaf, not below 0 in the mesh
    friend bool operator==(const PointValues& a, const PointValues& b);  ///< bit for bit
};

/// The leaves that a scheduler shows, with their samples, and the seam rule over them: the values that
/// Reconstruction gives over a tree and a store of the same leaves whose extension holds every point outside
/// the mesh, bit for bit, for leaves that come and go. Values outside the mesh are floats, as in an
/// extension. Reading is thread-safe while nothing is applied.
class ShownBricks {
  public:
    /// @param fields indices into mesh.fields: the channels of the samples. The mesh and `nearest` must
    /// outlive it. @param brickCells of every brick, an even number.
    ShownBricks(const TetMesh& mesh, std::span<const int> fields, int brickCells,
                const NearestOnDemand& nearest);

    /// Without a mesh: the samples have values outside it too, and distances where they are known, as those
    /// of showStored() do.
    ShownBricks(int channels, int brickCells);

    /// Takes leaves away and adds others. Throws InternalError when a leaf to remove doesn't stand.
    void apply(const Publication& publication, const Execution& execution);

    int channels() const { return channels_; }
    int brickCells() const { return cells_; }
    std::size_t leafCount() const { return leafCount_; }
    /// Whether exactly this leaf stands.
    bool isShown(const GrowingLeaf& leaf) const;
    /// The closed box of a brick in the lattice of its depth: (B + 1)^3 points.
    IndexBox closedPoints(const DepthKey& key) const {
        return {key.index * cells_, (key.index + 1) * cells_ + 1};
    }

    /// Of points in the closed box of a leaf shown, x fastest.
    PointValues valuesAt(const GrowingLeaf& leaf, const IndexBox& points) const;
    /// The points of a leaf whose values may change when leaves come or go inside these bricks: parts of its
    /// border, each in one plane; they may overlap.
    std::vector<IndexBox> touchedPoints(const DepthKey& leaf, std::span<const DepthKey> changed) const;

  private:
    struct Leaf {
        GrowingLeaf leaf;
        std::shared_ptr<const Block> samples;          ///< null: no leaf has this number
        std::shared_ptr<const SurfacePoints> surface;  ///< null: none is known
        /// Values of points on the brick's border or at the surface that are outside the mesh: their offsets
        /// in the closed box, ascending, and their channels.
        std::vector<std::uint32_t> outside;
        std::vector<double> outsideValues;
    };
    class NearestWalk;
    /// What is at a point.
    struct Point {
        PointSource source = PointSource::covered;
        double surface = 0;  ///< voxels of the depth asked for
    };
    /// Of a point whose distance isn't known.
    enum class Unknown {
        far,       ///< no cell that it is a corner of meets the surface
        measured,  ///< where there is a mesh
    };

    template <class Near>
    Point resolve(Depth depth, const Vec3i& p, const Leaf& asking, Unknown unknown, Near&& near,
                  NearestWalk& walk, std::span<double> values) const;
    Point fromCoarse(Depth depth, const Vec3i& p, const Leaf& coarse, Unknown unknown, NearestWalk& walk,
                     std::span<double> values) const;
    double surfaceAt(const Leaf& leaf, const Vec3i& p, PointSource source, Unknown unknown) const;
    PointSource ownSample(const Leaf& leaf, const Vec3i& p, NearestWalk& walk,
                          std::span<double> values) const;
    void nearestValues(const Leaf& leaf, const Vec3i& p, NearestWalk& walk, std::span<double> values) const;
    void findOutside(Leaf& leaf) const;
    const Leaf* findCovering(const DepthKey& key) const;
    IndexBox pointsInside(const DepthKey& key, Depth depth) const;
    bool isOnBorder(const Vec3i& local) const;

    const TetMesh* mesh_ = nullptr;             // null: the samples have what is outside it
    const NearestOnDemand* nearest_ = nullptr;  // as mesh_
    int channels_;
    int cells_;
    std::vector<std::pair<int, int>> channelOf_;  // of the mesh: (field, component) of each channel
    std::vector<Leaf> leaves_;                    // by GrowingLeaf::slot
    std::size_t leafCount_ = 0;
    BrickIndex index_;  // with GrowingLeaf::slot as the number
};

}  // namespace tessera
