#include "render/effects/outline.h"

#include <memory>

#include "mesh/shell_edges.h"

namespace tessera {

Effect outlineEffect(const std::vector<std::array<Vec3d, 2>>& edges, const Outline& outline) {
    auto lines = std::make_shared<PictureLines>();
    for (const auto& [from, to] : edges)
        lines->segments.push_back({from, to, outline.color, outline.widthPixels, true});
    Effect effect;
    effect.name = "outline";
    effect.lines = [lines](const LineView& view) {
        PictureLines shown = *lines;
        // The surface of bricks is within half a voxel of the mesh's, a ray that runs askew meets it a voxel
        // earlier, and it would swallow the edges.
        for (LineSegment& segment : shown.segments) segment.nearerWorld = view.coarsestSpacingWorld;
        return shown;
    };
    return effect;
}

Effect outlineEffect(const TetMesh& mesh, const Outline& outline) {
    std::vector<std::array<Vec3d, 2>> edges;
    for (const auto& [from, to] : shellEdges(mesh, outline.leastDegrees))
        edges.push_back({mesh.points[std::size_t(from)], mesh.points[std::size_t(to)]});
    return outlineEffect(edges, outline);
}

}  // namespace tessera
