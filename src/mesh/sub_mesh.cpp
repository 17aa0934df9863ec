#include "mesh/sub_mesh.h"

#include <algorithm>
#include <bit>

#include "base/check.h"
#include "mesh/element_index.h"

namespace tessera {

namespace {

/// Items lie anywhere: they are asked for this many ahead of their use.
constexpr std::size_t kAhead = 16;

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

/// Up to so many corners are numbered by a hash table, more by bits over all nodes.
constexpr std::size_t kFewCorners = 8192;

/// The nodes of some elements in ascending order, and for each element's corners their places among them.
class NodeNumbers {
  public:
    NodeNumbers(const TetMesh& mesh, std::span<const std::int32_t> elements) {
        places_.resize(4 * elements.size());
        for (std::size_t i = 0; i < elements.size(); ++i) {
            if (i + kAhead < elements.size())
                __builtin_prefetch(&mesh.tets[std::size_t(elements[i + kAhead])]);
            const auto& tet = mesh.tets[std::size_t(elements[i])];
            for (std::size_t k = 0; k < 4; ++k) places_[4 * i + k] = tet[k];
        }
        if (places_.size() <= kFewCorners)
            numberFew();
        else
            numberMany();
    }

    const std::vector<std::int32_t>& nodes() const { return nodes_; }
    /// Of corner i % 4 of element i / 4.
    std::int32_t place(std::size_t i) const { return places_[i]; }

  private:
    void numberFew() {
        struct Slot {
            std::int32_t node = -1, place = 0;
        };
        static thread_local std::vector<Slot> slots;
        const std::size_t size = std::bit_ceil(2 * places_.size() + 2);
        slots.assign(size, Slot{});
        const int shift = 64 - std::countr_zero(size);
        const auto slotOf = [&](std::int32_t node) -> Slot& {
            std::size_t at = std::size_t((std::uint64_t(node) * 0x9e3779b97f4a7c15ull) >> shift);
            while (slots[at].node >= 0 && slots[at].node != node) at = (at + 1) & (size - 1);
            return slots[at];
        };
        for (std::int32_t& node : places_) {
            Slot& slot = slotOf(node);
            if (slot.node < 0) {
                slot.node = node;
                nodes_.push_back(node);
            }
            node = std::int32_t(&slot - slots.data());
        }
        sortAscending(nodes_);
        for (std::size_t i = 0; i < nodes_.size(); ++i) slotOf(nodes_[i]).place = std::int32_t(i);
        for (std::int32_t& place : places_) place = slots[std::size_t(place)].place;
    }

    void numberMany() {
        struct Word {
            std::uint32_t bits = 0;
            std::int32_t before = 0;  // nodes of the words before
        };
        const auto [least, most] = std::minmax_element(places_.begin(), places_.end());
        const std::int32_t first = *least;
        std::vector<Word> words(std::size_t(*most - first) / 32 + 1);
        for (const std::int32_t node : places_) {
            const std::size_t bit = std::size_t(node - first);
            words[bit / 32].bits |= std::uint32_t(1) << bit % 32;
        }
        for (std::size_t w = 0; w < words.size(); ++w) {
            words[w].before = std::int32_t(nodes_.size());
            for (std::uint32_t bits = words[w].bits; bits != 0; bits &= bits - 1)
                nodes_.push_back(first + std::int32_t(32 * w) + std::countr_zero(bits));
        }
        for (std::int32_t& node : places_) {
            const std::size_t bit = std::size_t(node - first);
            const Word& word = words[bit / 32];
            node = word.before + bitCount(word.bits & ((std::uint32_t(1) << bit % 32) - 1));
        }
    }

    /// std::popcount() is a call where the processor isn't known to have it.
    static std::int32_t bitCount(std::uint32_t bits) {
        bits -= (bits >> 1) & 0x55555555;
        bits = (bits & 0x33333333) + ((bits >> 2) & 0x33333333);
        return std::int32_t(((bits + (bits >> 4)) & 0x0f0f0f0f) * 0x01010101 >> 24);
    }

    std::vector<std::int32_t> places_, nodes_;
};

}  // namespace

TetMesh extractElements(const TetMesh& mesh, std::span<const std::int32_t> elements,
                        std::span<const int> fields) {
    std::int32_t last = -1;
    for (const std::int32_t e : elements) {
        TESSERA_CHECK(e > last && e < mesh.elementCount(), "elements of a part ascend and are in the mesh");
        last = e;
    }
    const NodeNumbers numbers(mesh, elements);
    const std::vector<std::int32_t>& nodes = numbers.nodes();
    TetMesh part;
    part.points.reserve(nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
        __builtin_prefetch(&mesh.points[std::size_t(nodes[std::min(i + kAhead, nodes.size() - 1)])]);
        part.points.push_back(mesh.points[std::size_t(nodes[i])]);
    }
    part.tets.resize(elements.size());
    for (std::size_t i = 0; i < 4 * elements.size(); ++i) part.tets[i / 4][i % 4] = numbers.place(i);
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        part.fields.push_back(extractField(field, field.location == FieldLocation::cell ? elements : nodes));
    }
    return part;
}

}  // namespace tessera
