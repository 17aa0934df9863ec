#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "reference/ray_elements.h"
#include "tessera/execution.h"
#include "tessera/focus.h"
#include "tessera/mesh.h"

namespace tessera {

/// Where the rays through the middles of a camera's pixels run inside a mesh: each is cut with the elements
/// themselves, so pictures of several reconstructions have one outline, that of the mesh.
class MeshRays {
  public:
    /// Throws InputError for a camera that sees nothing.
    MeshRays(const TetMesh& mesh, const Camera& camera, const Execution& execution);

    const Camera& camera() const { return camera_; }
    /// Parts of the ray in front of the eye that lie in elements of some volume: disjoint, the nearest first.
    /// @param x, y a pixel, counted from the top left.
    std::span<const RaySpan> spans(int x, int y) const {
        const Row& row = rows_[std::size_t(y)];
        const std::size_t first = row.first[std::size_t(x)];
        return std::span(row.spans).subspan(first, row.first[std::size_t(x) + 1] - first);
    }
    /// Pixels whose ray meets the mesh.
    std::int64_t pixelCount() const;

  private:
    struct Row {
        std::vector<std::size_t> first;  ///< of each pixel, and the end
        std::vector<RaySpan> spans;
    };
    Camera camera_;
    std::vector<Row> rows_;
};

}  // namespace tessera
