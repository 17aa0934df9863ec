#include "mesh/box_tree.h"

#include <algorithm>
#include <limits>

namespace tessera {

namespace {

constexpr std::int64_t kChunk = 1 << 14;

struct CodedItem {
    std::uint64_t code;
    std::int32_t item;
    bool operator<(const CodedItem& other) const {
        return code != other.code ? code < other.code : item < other.item;
    }
};

/// Spreads the low 21 bits to every third bit.
std::uint64_t spreadBits(std::uint64_t x) {
    x = (x | x << 32) & 0x1f00000000ffffull;
    x = (x | x << 16) & 0x1f0000ff0000ffull;
    x = (x | x << 8) & 0x100f00f00f00f00full;
    x = (x | x << 4) & 0x10c30c30c30c30c3ull;
    return (x | x << 2) & 0x1249249249249249ull;
}

std::uint64_t mortonCode(const Vec3d& place, const Vec3d& origin, double scale) {
    std::uint64_t code = 0;
    for (int k = 0; k < 3; ++k) {
        const double x = (place[k] - origin[k]) * scale;
        const auto cell = x > 0 ? std::uint64_t(std::min(x, 2097151.0)) : 0;   // NaN ends in cell 0
        code |= spreadBits(cell) << k;
    }
    return code;
}

/// Sorts fixed runs, then merges them pairwise: the same result for any number of threads.
void sortItems(std::vector<CodedItem>& items, const Execution& execution) {
    const auto count = std::int64_t(items.size());
    const std::int64_t run = std::max<std::int64_t>(kChunk, (count + 15) / 16);
    parallelForChunks(execution, count, run, [&](std::int64_t begin, std::int64_t end) {
        std::sort(items.begin() + begin, items.begin() + end);
    });
    std::vector<CodedItem> merged(items.size());
    for (std::int64_t width = run; width < count; width *= 2) {
        parallelForChunks(execution, count, 2 * width, [&](std::int64_t begin, std::int64_t end) {
            const std::int64_t middle = std::min(begin + width, end);
            std::merge(items.begin() + begin, items.begin() + middle, items.begin() + middle, items.begin() + end,
                       merged.begin() + begin);
        });
        items.swap(merged);
    }
}

BoxTree::Node emptyNode() {
    BoxTree::Node node;
    for (auto& axis : node.min) axis.fill(std::numeric_limits<double>::infinity());
    for (auto& axis : node.max) axis.fill(-std::numeric_limits<double>::infinity());
    return node;
}

void setChild(BoxTree::Node& node, std::size_t c, const Box3d& box) {
    for (int k = 0; k < 3; ++k) {
        node.min[std::size_t(k)][c] = box.min[k];
        node.max[std::size_t(k)][c] = box.max[k];
    }
}

Box3d boundsOf(const BoxTree::Node& node) {
    Box3d box;
    for (int k = 0; k < 3; ++k) {
        box.min[k] = *std::min_element(node.min[std::size_t(k)].begin(), node.min[std::size_t(k)].end());
        box.max[k] = *std::max_element(node.max[std::size_t(k)].begin(), node.max[std::size_t(k)].end());
    }
    return box;
}

/// One level of nodes over `count` children; boxOf(i) gives the box of child i.
template <class BoxOf>
std::vector<BoxTree::Node> buildLevel(std::int64_t count, const Execution& execution, const BoxOf& boxOf) {
    const std::int64_t nodes = (count + BoxTree::kWidth - 1) / BoxTree::kWidth;
    std::vector<BoxTree::Node> level{std::size_t(nodes)};
    parallelForChunks(execution, nodes, kChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t n = begin; n < end; ++n) {
            BoxTree::Node node = emptyNode();
            for (std::int64_t c = 0; c < BoxTree::kWidth && n * BoxTree::kWidth + c < count; ++c)
                setChild(node, std::size_t(c), boxOf(n * BoxTree::kWidth + c));
            level[std::size_t(n)] = node;
        }
    });
    return level;
}

}  // namespace

BoxTree::BoxTree(std::span<const Box3d> boxes, const Execution& execution) {
    if (boxes.empty()) return;
    const auto count = std::int64_t(boxes.size());
    Box3d bounds;
    for (const Box3d& box : boxes) bounds.include(box);
    const Vec3d size = bounds.size();
    const double extent = std::max({size.x, size.y, size.z});
    const double scale = extent > 0 ? 2097152.0 / extent : 0;
    std::vector<CodedItem> items(boxes.size());
    parallelForChunks(execution, count, kChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) {
            const Box3d& box = boxes[std::size_t(i)];
            items[std::size_t(i)] = {mortonCode(box.min + 0.5 * (box.max - box.min), bounds.min, scale), std::int32_t(i)};
        }
    });
    sortItems(items, execution);
    order_.resize(boxes.size());
    for (std::size_t i = 0; i < items.size(); ++i) order_[i] = items[i].item;

    levels_.push_back(buildLevel(count, execution, [&](std::int64_t place) {
        return boxes[std::size_t(order_[std::size_t(place)])];
    }));
    while (levels_.back().size() > 1) {
        const std::vector<Node>& below = levels_.back();
        auto level = buildLevel(std::int64_t(below.size()), execution,
                                [&](std::int64_t n) { return boundsOf(below[std::size_t(n)]); });
        levels_.push_back(std::move(level));
    }
}

}  // namespace tessera
