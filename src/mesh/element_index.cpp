#include "mesh/element_index.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

#include "base/large_pages.h"
#include "base/parallel.h"

namespace tessera {

namespace {

constexpr std::int64_t kIndexChunk = 1 << 13;
/// Elements are shared out to so many parts of the Morton curve, each of which is sorted by itself.
constexpr std::size_t kSortParts = 256;
/// Elements whose keys tell where the parts begin.
constexpr std::int64_t kSampledKeys = 16 * std::int64_t(kSortParts);
/// Fewer numbers are sorted by comparison.
constexpr std::size_t kRadixFrom = 512;
/// Numbers that lie so close together, in words of 64 bits, are sorted as bits.
constexpr std::size_t kWordsPerNumber = 2;
constexpr int kMortonBits = 21;
/// A place is mapped back with an error of at most this share of the bounds and their distance from the
/// origin.
constexpr double kUnmapSlack = 0x1p-48;

struct Keyed {
    std::uint64_t key;
    std::int32_t element;
    bool operator<(const Keyed& other) const {
        return key != other.key ? key < other.key : element < other.element;
    }
};

/// Two zero bits before each of the 21.
std::uint64_t spread(std::uint64_t x) {
    x = (x | x << 32) & 0x001f00000000ffffull;
    x = (x | x << 16) & 0x001f0000ff0000ffull;
    x = (x | x << 8) & 0x100f00f00f00f00full;
    x = (x | x << 4) & 0x10c30c30c30c30c3ull;
    return (x | x << 2) & 0x1249249249249249ull;
}

/// The largest float that isn't above a number, and the smallest that isn't below: of numbers that aren't
/// negative, without a branch.
float roundedDown(double x) {
    const float f = float(x);
    return std::bit_cast<float>(std::bit_cast<std::int32_t>(f) - std::int32_t(double(f) > x));
}
float roundedUp(double x) {
    const float f = float(x);
    return std::bit_cast<float>(std::bit_cast<std::int32_t>(f) + std::int32_t(double(f) < x));
}

/// Steps in a length of `size`; 0 where it has none to count by.
float stepsPer(float size) {
    const float scale = 256 / size;
    return std::isfinite(scale) ? scale : 0;
}

/// Which of a node's children meet a box, and which lie inside it; all are compared at once.
template <std::size_t kWidth>
struct Meetings {
    std::array<std::int32_t, kWidth> meets, isInside;
    template <class Node, class Box>
    Meetings(const Node& node, const Box& box) {
        meets.fill(1);
        isInside.fill(1);
        for (std::size_t a = 0; a < 3; ++a)
            for (std::size_t c = 0; c < kWidth; ++c) {
                meets[c] &= (node.min[a][c] <= box.max[a]) & (node.max[a][c] >= box.min[a]);
                isInside[c] &= (node.min[a][c] >= box.min[a]) & (node.max[a][c] <= box.max[a]);
            }
    }
};

/// One bit for each of eight bytes of 0 or 1.
unsigned bitsOf(const std::array<std::uint8_t, 8>& bytes) {
    static_assert(std::endian::native == std::endian::little);
    std::uint64_t word = 0;  // the product brings them together in the last byte
    std::memcpy(&word, bytes.data(), sizeof word);
    return unsigned(word * 0x0102040810204080u >> 56);
}

/// One bit for each of the group's elements whose box meets the one asked for, that in the group's steps.
template <class Group>
unsigned metInGroup(const Group& group, const std::array<std::uint8_t, 6>& steps, std::size_t elements) {
    std::array<std::uint8_t, 8> met;
    met.fill(1);
    for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t i = 0; i < met.size(); ++i)
            met[i] &= std::uint8_t((group.low[a][i] <= steps[3 + a]) & (group.high[a][i] >= steps[a]));
    return bitsOf(met) & ((1u << elements) - 1);
}

Box3d boxOf(const TetMesh& mesh, std::int64_t element) {
    Box3d box;
    for (const std::int32_t node : mesh.tets[std::size_t(element)])
        box.include(mesh.points[std::size_t(node)]);
    return box;
}

Box3d boundsOfElements(const TetMesh& mesh, const Execution& execution) {
    const std::int64_t count = mesh.elementCount();
    std::vector<Box3d> parts(std::size_t((count + kIndexChunk - 1) / kIndexChunk));
    parallelForChunks(execution, count, kIndexChunk, [&](std::int64_t begin, std::int64_t end) {
        Box3d box;
        for (std::int64_t e = begin; e < end; ++e) box.include(boxOf(mesh, e));
        parts[std::size_t(begin / kIndexChunk)] = box;
    });
    Box3d bounds;
    for (const Box3d& part : parts) bounds.include(part);
    return bounds;
}

}  // namespace

void sortEachOnce(std::vector<std::int32_t>& numbers, std::size_t from) {
    const std::size_t count = numbers.size() - from;
    std::int32_t* first = numbers.data() + from;
    const auto dropRepeated = [&] {
        numbers.erase(std::unique(numbers.begin() + std::ptrdiff_t(from), numbers.end()), numbers.end());
    };
    if (count < kRadixFrom) {
        std::sort(first, first + count);
        return dropRepeated();
    }
    std::int32_t least = first[0], most = first[0];
    for (std::size_t i = 1; i < count; ++i) {
        least = std::min(least, first[i]);
        most = std::max(most, first[i]);
    }
    const std::size_t range = std::size_t(most - least) / 64 + 1;
    if (range <= kWordsPerNumber * count) {
        static thread_local std::vector<std::uint64_t> bits;
        bits.assign(range, 0);
        for (std::size_t i = 0; i < count; ++i) {
            const auto bit = std::uint32_t(first[i] - least);
            bits[bit / 64] |= std::uint64_t(1) << bit % 64;
        }
        std::int32_t* next = first;
        for (std::size_t w = 0; w < range; ++w)
            for (std::uint64_t word = bits[w]; word != 0; word &= word - 1)
                *next++ = least + std::int32_t(64 * w) + std::countr_zero(word);
        numbers.resize(std::size_t(next - numbers.data()));
        return;
    }
    constexpr int kBits = 11;
    constexpr std::size_t kBins = std::size_t(1) << kBits;
    static thread_local std::vector<std::int32_t> other;
    other.resize(count);
    std::int32_t *source = first, *target = other.data();
    for (int shift = 0; shift < 31 && (most >> shift) != 0; shift += kBits) {
        std::array<std::uint32_t, kBins> next{};
        for (std::size_t i = 0; i < count; ++i) ++next[std::size_t(source[i] >> shift) & (kBins - 1)];
        std::uint32_t sum = 0;
        for (std::uint32_t& bin : next) {
            const std::uint32_t size = bin;
            bin = sum;
            sum += size;
        }
        for (std::size_t i = 0; i < count; ++i)
            target[next[std::size_t(source[i] >> shift) & (kBins - 1)]++] = source[i];
        std::swap(source, target);
    }
    if (source != first) std::memcpy(first, source, count * sizeof *first);
    dropRepeated();
}

/// Places in a group's box, in 256ths of it.
struct ElementIndex::GroupSteps {
    std::array<float, 3> origin, perStep;

    explicit GroupSteps(const MappedBox& group) : origin(group.min) {
        for (std::size_t a = 0; a < 3; ++a) perStep[a] = stepsPer(group.max[a] - group.min[a]);
    }
    std::uint8_t at(std::size_t axis, float place) const {
        return std::uint8_t(std::clamp((place - origin[axis]) * perStep[axis], 0.0f, 255.0f));
    }
};

/// The boxes of one level of nodes, and of the groups below all.
struct ElementIndex::Builder {
    const TetMesh& mesh;
    ElementIndex& index;
    const Execution& execution;

    /// Place on the Morton curve of the middle of an element's box.
    std::uint64_t key(std::int64_t element) const {
        constexpr double kCells = double(1 << kMortonBits);
        const Box3d box = boxOf(mesh, element);
        std::uint64_t key = 0;
        for (int a = 0; a < 3; ++a) {
            const double middle = 0.5 * (index.mapped(box.min[a], a) + index.mapped(box.max[a], a));
            key |= spread(std::uint64_t(std::clamp(middle * kCells, 0.0, kCells - 1))) << a;
        }
        return key;
    }

    /// The first keys of all parts but the first: about as many elements lie in each, as a sample tells.
    std::array<std::uint64_t, kSortParts - 1> firstKeys() const {
        const std::int64_t count = std::min(mesh.elementCount(), kSampledKeys);
        std::vector<std::uint64_t> sample;
        for (std::int64_t i = 0; i < count; ++i) sample.push_back(key(i * mesh.elementCount() / count));
        std::sort(sample.begin(), sample.end());
        std::array<std::uint64_t, kSortParts - 1> first;
        for (std::size_t p = 0; p < first.size(); ++p)
            first[p] = sample[(p + 1) * sample.size() / kSortParts];
        return first;
    }

    // Memory that is touched for the first time costs more here than keys that are worked out twice, so a
    // thread keeps those of one part at a time.
    void sortElements() {
        const std::int64_t count = mesh.elementCount();
        const auto first = firstKeys();
        std::vector<std::uint8_t> partOf(mesh.tets.size());
        std::vector<std::array<std::uint32_t, kSortParts>> next(
            std::size_t((count + kIndexChunk - 1) / kIndexChunk));
        parallelForChunks(execution, count, kIndexChunk, [&](std::int64_t begin, std::int64_t end) {
            std::array<std::uint32_t, kSortParts>& sizes = next[std::size_t(begin / kIndexChunk)];
            for (std::int64_t e = begin; e < end; ++e) {
                const std::uint64_t k = key(e);
                std::size_t part = 0;
                for (std::size_t step = kSortParts / 2; step > 0; step /= 2)
                    part += first[part + step - 1] <= k ? step : 0;
                partOf[std::size_t(e)] = std::uint8_t(part);
                ++sizes[part];
            }
        });
        std::array<std::uint32_t, kSortParts + 1> partBegin{};
        for (std::size_t p = 0; p < kSortParts; ++p) {
            std::uint32_t place = partBegin[p];
            for (auto& chunk : next) place += std::exchange(chunk[p], place);
            partBegin[p + 1] = place;
        }
        resizeLarge(index.order_, mesh.tets.size());
        parallelForChunks(execution, count, kIndexChunk, [&](std::int64_t begin, std::int64_t end) {
            std::array<std::uint32_t, kSortParts>& places = next[std::size_t(begin / kIndexChunk)];
            for (std::int64_t e = begin; e < end; ++e)
                index.order_[places[partOf[std::size_t(e)]]++] = std::int32_t(e);
        });
        parallelFor(execution, kSortParts, [&](std::int64_t p) {
            const std::span<std::int32_t> part =
                std::span(index.order_)
                    .subspan(partBegin[std::size_t(p)],
                             partBegin[std::size_t(p) + 1] - partBegin[std::size_t(p)]);
            std::vector<Keyed> keys;
            keys.reserve(part.size());
            for (const std::int32_t e : part) keys.push_back({key(e), e});
            std::sort(keys.begin(), keys.end());
            for (std::size_t i = 0; i < part.size(); ++i) part[i] = keys[i].element;
        });
    }

    MappedBox makeGroup(std::int64_t g) {
        const std::size_t begin = std::size_t(g) * kWidth;
        const std::size_t size = std::min<std::size_t>(kWidth, index.order_.size() - begin);
        Node boxes;
        MappedBox all = nothing();
        for (std::size_t i = 0; i < size; ++i) {
            const MappedBox box = index.mapped(boxOf(mesh, index.order_[begin + i]));
            include(all, box);
            for (std::size_t a = 0; a < 3; ++a) {
                boxes.min[a][i] = box.min[a];
                boxes.max[a][i] = box.max[a];
            }
        }
        const GroupSteps steps(all);
        Group& group = index.groups_[std::size_t(g)];
        for (std::size_t a = 0; a < 3; ++a)
            for (std::size_t i = 0; i < kWidth; ++i) {
                // Absent elements: low above high.
                group.low[a][i] = i < size ? steps.at(a, boxes.min[a][i]) : 255;
                group.high[a][i] = i < size ? steps.at(a, boxes.max[a][i]) : 0;
            }
        return all;
    }

    template <class BoxOf>
    std::vector<Node> makeLevel(std::int64_t children, const BoxOf& childBox) {
        const std::int64_t count = (children + kWidth - 1) / kWidth;
        std::vector<Node> level;
        resizeLarge(level, std::size_t(count));
        parallelForChunks(execution, count, kIndexChunk / kWidth, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t n = begin; n < end; ++n)
                for (std::int64_t c = 0; c < kWidth; ++c) {
                    const std::int64_t below = n * kWidth + c;
                    const MappedBox box = below < children ? childBox(below) : nothing();
                    for (std::size_t a = 0; a < 3; ++a) {
                        level[std::size_t(n)].min[a][std::size_t(c)] = box.min[a];
                        level[std::size_t(n)].max[a][std::size_t(c)] = box.max[a];
                    }
                }
        });
        return level;
    }

    static MappedBox nothing() {
        constexpr float kInfinity = std::numeric_limits<float>::infinity();
        MappedBox box;
        box.min.fill(kInfinity);
        box.max.fill(-kInfinity);
        return box;
    }
    static void include(MappedBox& box, const MappedBox& other) {
        for (std::size_t a = 0; a < 3; ++a) {
            box.min[a] = std::min(box.min[a], other.min[a]);
            box.max[a] = std::max(box.max[a], other.max[a]);
        }
    }

    void build() {
        sortElements();
        const std::int64_t groups = (mesh.elementCount() + kWidth - 1) / kWidth;
        resizeLarge(index.groups_, std::size_t(groups));
        index.levels_.push_back(makeLevel(groups, [&](std::int64_t g) { return makeGroup(g); }));
        while (index.levels_.back().size() > 1) {
            const std::vector<Node>& below = index.levels_.back();
            auto level = makeLevel(std::int64_t(below.size()), [&](std::int64_t n) {
                MappedBox box = nothing();
                for (std::size_t c = 0; c < kWidth; ++c) include(box, child(below[std::size_t(n)], c));
                return box;
            });
            index.levels_.push_back(std::move(level));
        }
    }
};

ElementIndex::ElementIndex(const TetMesh& mesh, const Execution& execution) {
    if (mesh.tets.empty()) return;
    boundsWorld_ = boundsOfElements(mesh, execution);
    for (int a = 0; a < 3; ++a) {
        // Where this isn't a number to count by, everything lies in one place along the axis.
        const double scale = 1 / (boundsWorld_.max[a] - boundsWorld_.min[a]);
        scale_[a] = std::isfinite(scale) ? scale : 0;
    }
    Builder{mesh, *this, execution}.build();
}

std::int64_t ElementIndex::memoryBytes() const {
    std::size_t bytes = order_.size() * sizeof order_[0] + groups_.size() * sizeof groups_[0];
    for (const auto& level : levels_) bytes += level.size() * sizeof(Node);
    return std::int64_t(bytes);
}

// Mapping and rounding never change an order, so boxes that meet still do.
ElementIndex::MappedBox ElementIndex::mapped(const Box3d& box) const {
    MappedBox result;
    for (std::size_t a = 0; a < 3; ++a) {
        result.min[a] = roundedDown(mapped(box.min[int(a)], int(a)));
        result.max[a] = roundedUp(mapped(box.max[int(a)], int(a)));
    }
    return result;
}

Box3d ElementIndex::unmapped(const MappedBox& box) const {
    Box3d result;
    for (int a = 0; a < 3; ++a) {
        const double low = boundsWorld_.min[a], high = boundsWorld_.max[a];
        if (scale_[a] == 0) {
            result.min[a] = low;
            result.max[a] = high;
            continue;
        }
        const double size = high - low;
        const double slack = kUnmapSlack * (std::abs(low) + size);
        result.min[a] = low + size * double(box.min[std::size_t(a)]) - slack;
        result.max[a] = low + size * double(box.max[std::size_t(a)]) + slack;
    }
    return result;
}

ElementIndex::MappedBox ElementIndex::child(const Node& node, std::size_t c) {
    return {{node.min[0][c], node.min[1][c], node.min[2][c]},
            {node.max[0][c], node.max[1][c], node.max[2][c]}};
}

void ElementIndex::elementsOn(std::size_t axis, const Group& group, const MappedBox& groupBox,
                              std::array<float, kWidth>& min, std::array<float, kWidth>& max) {
    const float low = groupBox.min[axis], high = groupBox.max[axis], size = high - low;
    if (stepsPer(size) == 0) {
        min.fill(low);
        max.fill(high);
        return;
    }
    const float step = size * 0x1p-8f;
    for (std::size_t i = 0; i < kWidth; ++i) {
        // One step more on either side stands above all rounding.
        min[i] = std::max(low, low + (float(group.low[axis][i]) - 1) * step);
        max[i] = std::min(high, low + (float(group.high[axis][i]) + 2) * step);
    }
}

std::array<std::uint8_t, 6> ElementIndex::stepsWithin(const MappedBox& box, const MappedBox& group) {
    const GroupSteps steps(group);
    return {steps.at(0, box.min[0]), steps.at(1, box.min[1]), steps.at(2, box.min[2]),
            steps.at(0, box.max[0]), steps.at(1, box.max[1]), steps.at(2, box.max[2])};
}

std::span<const std::int32_t> ElementIndex::elementsBelow(std::size_t level, std::int64_t child) const {
    std::int64_t span = kWidth;
    for (std::size_t l = 0; l < level; ++l) span *= kWidth;
    const std::int64_t first = child * span;
    return std::span(order_).subspan(std::size_t(first), std::size_t(std::min(span, elementCount() - first)));
}

bool ElementIndex::clip(const Box3d& boxWorld, MappedBox& box) const {
    if (levels_.empty()) return false;
    const Box3d inside{glm::max(boxWorld.min, boundsWorld_.min), glm::min(boxWorld.max, boundsWorld_.max)};
    if (inside.empty()) return false;
    box = mapped(inside);
    return true;
}

/// A grid's planes, in shares of the mesh's bounds: on each axis every whole number.
struct ElementIndex::Comb {
    std::array<float, 3> scale, low, high;  // place * scale + low or high, of a box enlarged by the margin

    /// Null where floats don't tell the planes apart.
    static std::optional<Comb> make(const ElementIndex& index, const PointGrid& grid) {
        constexpr double kMostPlanes = 1 << 15, kRounding = 0x1p-6;
        Comb comb;
        for (int a = 0; a < 3; ++a) {
            const double phase = (index.boundsWorld_.min[a] - grid.originWorld[a]) / grid.spacingWorld[a];
            const double planes = 1 / (index.scale_[a] * grid.spacingWorld[a]);
            const double margin = grid.margin + kRounding;
            const double first = phase - std::floor(phase) + std::ceil(margin) + 1;  // numbers stay positive
            if (!(planes < kMostPlanes && std::abs(phase) < 0x1p40)) return {};
            comb.scale[std::size_t(a)] = float(planes);
            comb.low[std::size_t(a)] = float(first - margin);
            comb.high[std::size_t(a)] = float(first + margin);
        }
        return comb;
    }

    bool meets(std::size_t axis, float min, float max) const {
        return float(std::int32_t(max * scale[axis] + high[axis])) >= min * scale[axis] + low[axis];
    }
    bool meets(const MappedBox& box) const {
        return meets(0, box.min[0], box.max[0]) & meets(1, box.min[1], box.max[1]) &
               meets(2, box.min[2], box.max[2]);
    }
    /// One bit for each of a group's elements; all are compared at once.
    unsigned metInGroup(const Group& group, const MappedBox& groupBox) const {
        std::array<std::uint8_t, kWidth> met;
        met.fill(1);
        for (std::size_t a = 0; a < 3; ++a) {
            std::array<float, kWidth> min, max;
            elementsOn(a, group, groupBox, min, max);
            for (std::size_t i = 0; i < kWidth; ++i) met[i] &= std::uint8_t(meets(a, min[i], max[i]));
        }
        return bitsOf(met);
    }
};

// Calls visit(element) for those in the box that some point of the comb may be near.
template <class Visit>
void ElementIndex::comb(std::size_t level, std::int64_t n, const MappedBox& box, const Comb& points,
                        const Visit& visit) const {
    const Node& node = levels_[level][std::size_t(n)];
    const Meetings<kWidth> meeting(node, box);
    for (std::size_t c = 0; c < kWidth; ++c) {
        if (!meeting.meets[c]) continue;
        const MappedBox below = child(node, c);
        if (!points.meets(below)) continue;
        const std::int64_t number = n * kWidth + std::int64_t(c);
        if (level > 0) {
            comb(level - 1, number, box, points, visit);
            continue;
        }
        const Group& group = groups_[std::size_t(number)];
        const std::span<const std::int32_t> elements = elementsBelow(level, number);
        unsigned met = points.metInGroup(group, below) & ((1u << elements.size()) - 1);
        if (!meeting.isInside[c]) met &= metInGroup(group, stepsWithin(box, below), elements.size());
        for (; met != 0; met &= met - 1) visit(elements[std::size_t(std::countr_zero(met))]);
    }
}

void ElementIndex::query(std::size_t level, std::int64_t n, const MappedBox& box, std::size_t most,
                         std::vector<std::int32_t>& elements) const {
    const Node& node = levels_[level][std::size_t(n)];
    const Meetings<kWidth> meeting(node, box);
    for (std::size_t c = 0; c < kWidth && elements.size() <= most; ++c) {
        if (!meeting.meets[c]) continue;
        const std::int64_t below = n * kWidth + std::int64_t(c);
        if (meeting.isInside[c]) {
            const std::span<const std::int32_t> all = elementsBelow(level, below);
            elements.insert(elements.end(), all.begin(), all.end());
        } else if (level > 0) {
            query(level - 1, below, box, most, elements);
        } else {
            const std::span<const std::int32_t> group = elementsBelow(level, below);
            unsigned met =
                metInGroup(groups_[std::size_t(below)], stepsWithin(box, child(node, c)), group.size());
            for (; met != 0; met &= met - 1) elements.push_back(group[std::size_t(std::countr_zero(met))]);
        }
    }
}

// About how many of the elements below a box meet another one, that it meets: as if they were alike and lay
// evenly, a third as long as their box.
std::int64_t ElementIndex::shareOf(std::int64_t elements, const MappedBox& below, const MappedBox& box) {
    constexpr float kLength = 0.35f;
    float share = 1;
    for (std::size_t a = 0; a < 3; ++a) {
        const float size = below.max[a] - below.min[a];
        const float common = std::min(below.max[a], box.max[a]) - std::max(below.min[a], box.min[a]);
        if (size > 0) share *= (common / size + kLength) / (1 + kLength);
    }
    return std::clamp(std::int64_t(share * float(elements) + 0.5f), std::int64_t(1), elements);
}

std::int64_t ElementIndex::count(std::size_t level, std::int64_t n, const MappedBox& box,
                                 std::size_t smallest) const {
    const Node& node = levels_[level][std::size_t(n)];
    std::int64_t sum = 0;
    const Meetings<kWidth> meeting(node, box);
    for (std::size_t c = 0; c < kWidth; ++c) {
        if (!meeting.meets[c]) continue;
        const std::int64_t below = n * kWidth + std::int64_t(c);
        const auto all = std::int64_t(elementsBelow(level, below).size());
        if (meeting.isInside[c])
            sum += all;
        else if (std::size_t(all) <= smallest)
            sum += shareOf(all, child(node, c), box);
        else if (level > 0)
            sum += count(level - 1, below, box, smallest);
        else
            sum += std::popcount(metInGroup(groups_[std::size_t(below)], stepsWithin(box, child(node, c)),
                                            elementsBelow(level, below).size()));
    }
    return sum;
}

void ElementIndex::query(const Box3d& boxWorld, std::vector<std::int32_t>& elements, std::size_t most,
                         const PointGrid* grid) const {
    MappedBox box;
    if (!clip(boxWorld, box)) return;
    const std::size_t first = elements.size();
    const std::optional<Comb> points = grid ? Comb::make(*this, *grid) : std::nullopt;
    if (points)
        comb(levels_.size() - 1, 0, box, *points, [&](std::int32_t e) { elements.push_back(e); });
    else
        query(levels_.size() - 1, 0, box, most, elements);
    if (elements.size() <= most) sortEachOnce(elements, first);
}

std::int64_t ElementIndex::count(const Box3d& boxWorld, const PointGrid* grid) const {
    MappedBox box;
    if (!clip(boxWorld, box)) return 0;
    const std::optional<Comb> points = grid ? Comb::make(*this, *grid) : std::nullopt;
    if (!points) return count(levels_.size() - 1, 0, box, 0);
    std::int64_t sum = 0;
    comb(levels_.size() - 1, 0, box, *points, [&](std::int32_t) { ++sum; });
    return sum;
}

std::int64_t ElementIndex::countAbout(const Box3d& boxWorld) const {
    constexpr std::size_t kSmallest = 64;
    MappedBox box;
    return clip(boxWorld, box) ? count(levels_.size() - 1, 0, box, kSmallest) : 0;
}

const ElementIndex& SharedElementIndex::get(const Execution& execution) const {
    if (const ElementIndex* built = ifBuilt()) return *built;
    const std::lock_guard lock(mutex_);
    if (!index_) {
        index_ = std::make_unique<const ElementIndex>(*mesh_, execution.withoutProgress());
        built_.store(index_.get(), std::memory_order_release);
    }
    return *index_;
}

}  // namespace tessera
