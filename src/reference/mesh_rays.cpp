#include "reference/mesh_rays.h"

#include <algorithm>

#include "base/parallel.h"

namespace tessera {

namespace {

/// Appends the union of spans, ascending.
void appendUnion(std::vector<ElementSpan>& spans, std::vector<RaySpan>& all) {
    std::sort(spans.begin(), spans.end(),
              [](const ElementSpan& a, const ElementSpan& b) { return a.span.begin < b.span.begin; });
    const std::size_t first = all.size();
    for (const auto& [span, element] : spans) {
        if (all.size() > first && span.begin <= all.back().end * (1 + kTouching))
            all.back().end = std::max(all.back().end, span.end);
        else
            all.push_back(span);
    }
}

}  // namespace

MeshRays::MeshRays(const TetMesh& mesh, const Camera& camera, const Execution& execution) : camera_(camera) {
    const RayElements elements(mesh, camera, execution);
    rows_.resize(std::size_t(camera.heightPixels));
    parallelFor(execution, camera.heightPixels, [&](std::int64_t y) {
        Row& row = rows_[std::size_t(y)];
        for (std::vector<ElementSpan>& spans : elements.ofRow(int(y))) {
            row.first.push_back(row.spans.size());
            appendUnion(spans, row.spans);
        }
        row.first.push_back(row.spans.size());
    });
}

std::int64_t MeshRays::pixelCount() const {
    std::int64_t count = 0;
    for (const Row& row : rows_)
        for (std::size_t x = 0; x + 1 < row.first.size(); ++x) count += row.first[x] < row.first[x + 1];
    return count;
}

}  // namespace tessera
