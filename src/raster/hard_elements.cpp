#include "raster/hard_elements.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "base/parallel.h"
#include "raster/prepared_region.h"
#include "software/scan_kernel.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

/// Hard elements are worked in cells of this edge, so that a few of them don't cost a whole region.
constexpr int kScratchEdge = 32;

/// A part of a region and the hard elements that reach it, ascending.
struct Cell {
    IndexBox points;
    std::vector<std::int32_t> elements;
};

std::vector<Cell> sortIntoCells(const RasterInputs& inputs, const PreparedRegion& region) {
    const Vec3i size = region.points.size();
    const Vec3i counts = (size + (kScratchEdge - 1)) / kScratchEdge;
    std::vector<Cell> cells(std::size_t(counts.x) * std::size_t(counts.y) * std::size_t(counts.z));
    for (const std::int32_t element : region.hard) {
        const ElementShape shape = shapeElement(inputs.mesh, inputs.frame, element);
        const IndexBox within = pointsAbout(shape, region.points);
        if (within.empty()) continue;
        const Vec3i low = (within.min - region.points.min) / kScratchEdge;
        const Vec3i high = (within.max - 1 - region.points.min) / kScratchEdge;
        Vec3i c;
        for (c.z = low.z; c.z <= high.z; ++c.z)
            for (c.y = low.y; c.y <= high.y; ++c.y)
                for (c.x = low.x; c.x <= high.x; ++c.x) {
                    Cell& cell = cells[std::size_t((std::int64_t(c.z) * counts.y + c.y) * counts.x + c.x)];
                    const Vec3i corner = region.points.min + c * kScratchEdge;
                    cell.points = intersect({corner, corner + kScratchEdge}, region.points);
                    cell.elements.push_back(element);
                }
    }
    std::erase_if(cells, [](const Cell& cell) { return cell.elements.empty(); });
    return cells;
}

std::vector<DecidedPoint> decideCell(const RasterInputs& inputs, std::span<const ChannelCoding> codings,
                                     const IndexBox& region, const Cell& cell) {
    const auto count = std::size_t(cell.points.count());
    std::vector<ScanChannel> channels;
    std::vector<std::vector<float>> values(codings.size(), std::vector<float>(count));
    std::vector<float*> valuePointers;
    for (std::size_t c = 0; c < codings.size(); ++c) {
        const ChannelCoding& coding = codings[c];
        channels.push_back({coding.field().values.data(), coding.field().components, coding.component(),
                            coding.isOfCells()});
        valuePointers.push_back(values[c].data());
    }
    std::vector<std::uint8_t> marks(count, kNotCovered);
    std::vector<std::int32_t> owner(count);
    std::vector<double> rank(count);
    const Vec3i size = cell.points.size();
    const ScanInput scanInput{inputs.mesh, inputs.frame, channels};
    const ScanOutput output{cell.points,   cell.points,  {1, size.x, std::int64_t(size.x) * size.y},
                            valuePointers, marks.data(), owner.data(),
                            rank.data()};
    ScanCounts counts;
    scanTargets().front().scan(scanInput, output, cell.elements, counts);

    std::vector<DecidedPoint> points;
    const float invalid = sampleMarks(inputs.format).invalid;
    std::int32_t lastOwner = -1;
    std::optional<ElementDepth> depth;
    for (std::size_t i = 0; i < count; ++i) {
        if (marks[i] == kNotCovered) continue;
        const Vec3i at = output.pointAt(std::int64_t(i));
        const Vec3i pixel = at - region.min;
        // What follows in a run has the owner of the point before it.
        if (marks[i] == kStartsRun && (owner[i] & kElementMask) != lastOwner) {
            lastOwner = owner[i] & kElementMask;
            depth.emplace(inputs.mesh, inputs.frame, lastOwner);
        }
        DecidedPoint point{std::uint16_t(pixel[inputs.axes.s]),
                           std::uint16_t(pixel[inputs.axes.t]),
                           std::uint32_t(pixel[inputs.axes.l]),
                           float(depth->at(at)),
                           {0, 0, 0, 0}};
        for (std::size_t c = 0; c < channels.size(); ++c) {
            const float value = values[c][i];
            const float code = std::isfinite(value) ? float(codings[c].encode(double(value))) : invalid;
            point.codes[c] = std::fabs(code) < std::numeric_limits<float>::min() ? 0 : code;  // as codeAt()
        }
        points.push_back(point);
    }
    return points;
}

}  // namespace

std::vector<DecidedPoint> decideHardElements(const RasterInputs& inputs, const PreparedRegion& region,
                                             std::size_t pass, const Execution& execution) {
    if (region.hard.empty()) return {};
    const std::vector<Cell> cells = sortIntoCells(inputs, region);
    std::vector<std::vector<DecidedPoint>> ofCells(cells.size());
    parallelFor(execution, std::int64_t(cells.size()), [&](std::int64_t i) {
        ofCells[std::size_t(i)] =
            decideCell(inputs, inputs.channelsOf(pass), region.points, cells[std::size_t(i)]);
    });
    std::vector<DecidedPoint> points;
    for (const auto& ofCell : ofCells) points.insert(points.end(), ofCell.begin(), ofCell.end());
    return points;
}

}  // namespace tessera
