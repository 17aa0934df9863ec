#include "mesh/sub_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "base/check.h"
#include "mesh/element_index.h"

namespace tessera {

namespace {

/// Items lie anywhere: they are asked for this many ahead of their use.
constexpr std::size_t kAhead = 16, kElementsAhead = 64;

Field extractField(const Field& field, std::span<const std::int32_t> items) {
    Field part{field.name, field.location, field.components, {}};
    part.values.reserve(items.size() * std::size_t(field.components));
    for (std::size_t i = 0; i < items.size(); ++i) {
        const std::size_t ahead = std::size_t(items[std::min(i + kAhead, items.size() - 1)]);
        __builtin_prefetch(field.values.data() + ahead * std::size_t(field.components));
        for (int c = 0; c < field.components; ++c) part.values.push_back(field.at(items[i], c));
    }
    return part;
}

/// Corners are numbered by a hash table where there are few, or few for the range of their nodes.
constexpr std::size_t kFewCorners = 8192, kNodesPerCorner = 8;

using Tets = std::vector<std::array<std::int32_t, 4>>;

/// Numbers the nodes of some elements anew, in ascending order.
class NodeNumbers {
  public:
    explicit NodeNumbers(Tets& tets) : tets_(tets) {
        if (tets.empty()) return;
        std::array<std::int32_t, 4> least = tets_[0], most = tets_[0];
        for (const auto& tet : tets_)
            for (std::size_t k = 0; k < 4; ++k) {
                least[k] = std::min(least[k], tet[k]);
                most[k] = std::max(most[k], tet[k]);
            }
        first_ = *std::min_element(least.begin(), least.end());
        range_ = std::size_t(*std::max_element(most.begin(), most.end()) - first_) + 1;
        const std::size_t corners = 4 * tets.size();
        if (corners <= kFewCorners || range_ > kNodesPerCorner * corners)
            numberFew();
        else
            numberMany();
    }
    /// The old numbers by the new ones.
    const std::vector<std::int32_t>& nodes() const { return nodes_; }

  private:
    template <class Visit>
    void forEachCorner(const Visit& visit) {
        for (auto& tet : tets_)
            for (std::int32_t& node : tet) visit(node);
    }

    void numberFew() {
        struct Slot {
            std::int32_t node = -1, place = 0;
        };
        static thread_local std::vector<Slot> slots;
        const std::size_t size = std::bit_ceil(8 * tets_.size() + 2);
        slots.assign(size, Slot{});
        const int shift = 64 - std::countr_zero(size);
        const auto slotOf = [&](std::int32_t node) -> Slot& {
            std::size_t at = std::size_t((std::uint64_t(node) * 0x9e3779b97f4a7c15ull) >> shift);
            while (slots[at].node >= 0 && slots[at].node != node) at = (at + 1) & (size - 1);
            return slots[at];
        };
        forEachCorner([&](std::int32_t& node) {
            Slot& slot = slotOf(node);
            if (slot.node < 0) {
                slot.node = node;
                nodes_.push_back(node);
            }
            node = std::int32_t(&slot - slots.data());
        });
        sortEachOnce(nodes_);
        for (std::size_t i = 0; i < nodes_.size(); ++i) slotOf(nodes_[i]).place = std::int32_t(i);
        forEachCorner([&](std::int32_t& slot) { slot = slots[std::size_t(slot)].place; });
    }

    void numberMany() {
        constexpr std::size_t kWord = sizeof(std::uint64_t);
        static thread_local std::vector<std::uint8_t> isUsed;
        static thread_local std::vector<std::int32_t> places;  // of nodes in use
        isUsed.assign(range_ + kWord, 0);
        if (places.size() < range_) places.resize(range_);
        forEachCorner([&](const std::int32_t& node) { isUsed[std::size_t(node - first_)] = 1; });
        for (std::size_t n = 0; n < range_; n += kWord) {
            std::uint64_t word;
            std::memcpy(&word, isUsed.data() + n, kWord);
            for (; word != 0; word &= word - 1) {
                const std::size_t node = n + std::size_t(std::countr_zero(word)) / 8;
                places[node] = std::int32_t(nodes_.size());
                nodes_.push_back(first_ + std::int32_t(node));
            }
        }
        forEachCorner([&](std::int32_t& node) { node = places[std::size_t(node - first_)]; });
    }

    static_assert(std::endian::native == std::endian::little);
    Tets& tets_;
    std::int32_t first_ = 0;  // the least node in use
    std::size_t range_ = 0;   // of nodes from there to the last
    std::vector<std::int32_t> nodes_;
};

}  // namespace

TetMesh extractElements(const TetMesh& mesh, std::span<const std::int32_t> elements,
                        std::span<const int> fields) {
    TetMesh part;
    part.tets.resize(elements.size());
    std::int32_t last = -1;
    for (const std::int32_t e : elements) {
        TESSERA_CHECK(e > last && e < mesh.elementCount(), "elements of a part ascend and are in the mesh");
        last = e;
    }
    for (std::size_t i = 0; i < elements.size(); ++i) {
        if (i + kElementsAhead < elements.size())
            __builtin_prefetch(mesh.tets.data() + elements[i + kElementsAhead]);
        part.tets[i] = mesh.tets[std::size_t(elements[i])];
    }
    const NodeNumbers numbers(part.tets);
    const std::vector<std::int32_t>& nodes = numbers.nodes();
    part.points.reserve(nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        __builtin_prefetch(&mesh.points[std::size_t(nodes[std::min(i + kAhead, nodes.size() - 1)])]);
        part.points.push_back(mesh.points[std::size_t(nodes[i])]);
    }
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        part.fields.push_back(extractField(field, field.location == FieldLocation::cell ? elements : nodes));
    }
    return part;
}

}  // namespace tessera
