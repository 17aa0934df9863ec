#include "raster/published.h"

#include <cmath>

#include "base/parallel.h"
#include "raster/prepared_region.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

constexpr std::int64_t kPublishedChunk = 4096;

struct PublishedChunk {
    std::vector<SliceElement> elements;
    std::vector<PublishedGeometry> geometry;
    std::vector<std::vector<NodeCodes>> codes;  ///< a list a pass
};

PublishedGeometry geometryOf(const ElementShape& shape, const Vec3i& regionMin, const SliceAxes& axes) {
    PublishedGeometry geometry{};
    for (int k = 0; k < 4; ++k) {
        const auto at = [&](int axis) {
            return double(shape.first[axis]) - double(regionMin[axis]) + shape.node[k][axis];
        };
        geometry.node[k][0] = float(at(axes.s) + 0.5);
        geometry.node[k][1] = float(at(axes.t) + 0.5);
        geometry.node[k][2] = float(at(axes.l));
        geometry.rise[k] = float(shape.normal[k][axes.l] / shape.height[k]);
    }
    return geometry;
}

void prepareChunk(const RasterInputs& inputs, const IndexBox& points, std::span<const std::int32_t> elements,
                  PublishedChunk& chunk) {
    const float invalid = sampleMarks(inputs.format).invalid;
    chunk.codes.resize(inputs.passCount());
    for (const std::int32_t element : elements) {
        const ElementShape shape = shapeElement(inputs.mesh, inputs.frame, element);
        SliceElement e{};
        if (shape.grade == ShapeGrade::hard || !placeInRegion(shape, points, e)) continue;
        e.record = std::uint32_t(chunk.geometry.size());
        chunk.elements.push_back(e);
        chunk.geometry.push_back(geometryOf(shape, points.min, inputs.axes));
        for (std::size_t c = 0; c < inputs.channels.size(); ++c)
            chunk.codes[c / kChannelsAPass].push_back(
                codesAtNodes(inputs.channels[c], inputs.mesh, element, invalid));
        if (inputs.channels.empty()) chunk.codes[0].push_back({});
    }
}

}  // namespace

NodeCodes codesAtNodes(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element,
                       float invalid) {
    NodeCodes codes{};
    bool isFinite = true;
    for (std::size_t k = 0; k < 4; ++k) {
        const std::int64_t item = coding.isOfCells() ? element : mesh.tets[std::size_t(element)][k];
        const double value = coding.field().at(item, coding.component());
        isFinite = isFinite && std::isfinite(float(value));
        if (isFinite) codes.codes[k] = float(coding.encode(value));
    }
    if (!isFinite) return {{invalid, invalid, invalid, invalid}};
    return codes;
}

PreparedRegion preparePublishedRegion(const RasterInputs& inputs, const IndexBox& points,
                                      std::span<const std::int32_t> elements, const Execution& execution) {
    const auto count = std::int64_t(elements.size());
    std::vector<PublishedChunk> chunks(std::size_t((count + kPublishedChunk - 1) / kPublishedChunk));
    parallelForChunks(execution, count, kPublishedChunk, [&](std::int64_t begin, std::int64_t end) {
        prepareChunk(inputs, points, elements.subspan(std::size_t(begin), std::size_t(end - begin)),
                     chunks[std::size_t(begin / kPublishedChunk)]);
    });
    PreparedRegion region;
    region.points = points;
    region.nodeCodes.resize(inputs.passCount());
    for (const PublishedChunk& chunk : chunks) {
        const auto before = std::uint32_t(region.published.size());
        for (SliceElement e : chunk.elements) {
            e.record += before;
            region.elements.push_back(e);
        }
        region.published.insert(region.published.end(), chunk.geometry.begin(), chunk.geometry.end());
        for (std::size_t pass = 0; pass < chunk.codes.size(); ++pass)
            region.nodeCodes[pass].insert(region.nodeCodes[pass].end(), chunk.codes[pass].begin(),
                                          chunk.codes[pass].end());
    }
    return region;
}

}  // namespace tessera
