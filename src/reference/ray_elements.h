#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "refine/camera_view.h"
#include "tessera/execution.h"
#include "tessera/focus.h"
#include "tessera/mesh.h"

namespace tessera {

/// A part of a ray, by distances from where it starts, world units.
struct RaySpan {
    double begin = 0;
    double end = 0;
};

/// Gaps and overlaps of a ray's parts that are shorter than this share of their distance are rounding, where
/// elements share a face.
inline constexpr double kTouching = 1e-12;

/// The part of a ray in an element.
struct ElementSpan {
    RaySpan span;
    std::int64_t element = 0;
};

/// An element as four half-spaces dot(normals[f], p) >= offsets[f], p counted from an eye. The plane f is
/// that of the face across from the node f.
struct ElementPlanes {
    std::array<Vec3d, 4> normals;  ///< of any length
    std::array<double, 4> offsets;
    std::array<double, 4> atNodes;  ///< dot(normals[f], the node f) - offsets[f], above 0
};
/// None of a flat element.
std::optional<ElementPlanes> elementPlanes(const TetMesh& mesh, std::size_t element, const Vec3d& eyeWorld);

/// Cuts the rays through the middles of a camera's pixels with the elements of a mesh. Both must outlive it.
class RayElements {
  public:
    /// Throws InputError for a camera that sees nothing.
    RayElements(const TetMesh& mesh, const Camera& camera, const Execution& execution);

    const CameraView& view() const { return view_; }
    /// By pixel of a row counted from the top: what of its ray lies in elements of some volume, in front of
    /// where it starts, by index of the element.
    std::vector<std::vector<ElementSpan>> ofRow(int y) const;

  private:
    /// Pixels x0 to x1 and y0 to y1, ends included, whose rays may meet an element; none when y0 > y1.
    struct PixelBox {
        int x0 = 0, x1 = 0, y0 = 0, y1 = -1;
    };
    PixelBox pixelBox(std::size_t element) const;

    const TetMesh& mesh_;
    const Camera& camera_;
    CameraView view_;
    std::vector<PixelBox> boxes_;
};

}  // namespace tessera
