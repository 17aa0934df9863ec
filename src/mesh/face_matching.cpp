#include "mesh/face_matching.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <memory>
#include <utility>

#include "base/check.h"
#include "base/parallel.h"

namespace tessera {

namespace {

/// Nodes of the face opposite to local node f, seen counter-clockwise from outside when the volume is
/// positive.
constexpr std::array<std::array<std::size_t, 3>, 4> kFaceNodes{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

constexpr std::int64_t kElementChunk = 1 << 15;
/// Faces a bucket on average: it and its table stay in the second-level cache.
constexpr std::int64_t kBucketFaces = 1 << 14;

/// A face of one element. What matching needs of the element travels in the lowest bits, because looking it
/// up would miss the cache.
struct FaceRecord {
    std::uint32_t smallest;  // 2 * node + (1 when the element is flat)
    std::uint32_t middle;    // 2 * node + the lowest bit of the opposite node
    std::uint32_t largest;   // 2 * node + (1 when the opposite node is larger still)
    std::uint32_t id;        // 4 * element + local index of the opposite node

    bool isFlat() const { return smallest & 1; }
    bool oppositeIsLargest() const { return largest & 1; }
    bool sameFace(const FaceRecord& other) const {
        return ((smallest ^ other.smallest) | (middle ^ other.middle) | (largest ^ other.largest)) <= 1;
    }
    std::uint64_t hash() const {
        std::uint64_t h = (std::uint64_t(smallest / 2) << 32 | middle / 2) * 0x9e3779b97f4a7c15u;
        h = (h ^ (h >> 32) ^ largest / 2) * 0xbf58476d1ce4e5b9u;
        return h ^ (h >> 29);
    }
};

FaceRecord recordOf(const std::array<std::int32_t, 4>& tet, std::int64_t element, std::size_t f, bool flat) {
    std::int32_t a = tet[kFaceNodes[f][0]], b = tet[kFaceNodes[f][1]], c = tet[kFaceNodes[f][2]];
    if (a > b) std::swap(a, b);
    if (b > c) std::swap(b, c);
    if (a > b) std::swap(a, b);
    return {std::uint32_t(a) * 2 + flat, std::uint32_t(b) * 2 + (tet[f] & 1),
            std::uint32_t(c) * 2 + (tet[f] > c), std::uint32_t(element) * 4 + std::uint32_t(f)};
}

/// All faces that may count, in buckets by the high bits of their hash. Built by counting, so that every
/// chunk of elements writes to its own places.
struct FaceBuckets {
    int shift = 0;
    std::vector<std::int64_t> begin;
    std::unique_ptr<FaceRecord[]> records;

    std::int64_t count() const { return std::int64_t(begin.size()) - 1; }
};

/// @param faceCount about as many as mayCount(record) takes.
template <class MayCount>
FaceBuckets bucketFaces(const TetMesh& mesh, std::span<const std::uint8_t> flat, std::int64_t faceCount,
                        const MayCount& mayCount, const Execution& execution) {
    const std::int64_t elements = mesh.elementCount();
    const std::int64_t chunks = (elements + kElementChunk - 1) / kElementChunk;
    FaceBuckets buckets;
    const int bits = std::max(1, int(std::bit_width(std::uint64_t(faceCount / kBucketFaces))));
    buckets.shift = 64 - bits;
    const std::size_t bucketCount = std::size_t(1) << bits;
    const auto forEachFace = [&](std::int64_t chunk, const auto& visit) {
        const std::int64_t end = std::min(elements, (chunk + 1) * kElementChunk);
        for (std::int64_t e = chunk * kElementChunk; e < end; ++e)
            for (std::size_t f = 0; f < 4; ++f) {
                const FaceRecord record =
                    recordOf(mesh.tets[std::size_t(e)], e, f, flat[std::size_t(e)] != 0);
                if (mayCount(record)) visit(record, std::size_t(record.hash() >> buckets.shift));
            }
    };
    std::vector<std::vector<std::int64_t>> cursors{std::size_t(chunks)};
    parallelFor(execution, chunks, [&](std::int64_t chunk) {
        std::vector<std::int64_t> counts(bucketCount);
        forEachFace(chunk, [&](const FaceRecord&, std::size_t bucket) { ++counts[bucket]; });
        cursors[std::size_t(chunk)] = std::move(counts);
    });
    std::int64_t total = 0;
    for (std::size_t bucket = 0; bucket < bucketCount; ++bucket) {
        buckets.begin.push_back(total);
        for (auto& cursor : cursors) total += std::exchange(cursor[bucket], total);
    }
    buckets.begin.push_back(total);
    buckets.records = std::make_unique_for_overwrite<FaceRecord[]>(std::size_t(total));
    parallelFor(execution, chunks, [&](std::int64_t chunk) {
        std::vector<std::int64_t> cursor = std::move(cursors[std::size_t(chunk)]);
        forEachFace(chunk, [&](const FaceRecord& record, std::size_t bucket) {
            buckets.records[std::size_t(cursor[bucket]++)] = record;
        });
    });
    return buckets;
}

struct Counts {
    std::int64_t single = 0, paired = 0, crowded = 0, duplicate = 0;
};

/// Matches the faces of one bucket after the other.
class BucketMatcher {
  public:
    BucketMatcher(const TetMesh& mesh, std::vector<std::uint8_t>& isBoundary)
        : mesh_(mesh), isBoundary_(isBoundary) {}

    Counts counts;

    void match(std::span<const FaceRecord> records) {
        sortKeys(records);
        const std::size_t count = records.size();
        for (std::size_t begin = 0; begin < count;) {
            std::size_t end = begin + 1;
            while (end < count && keys_[end].code == keys_[begin].code) ++end;
            // Different faces may have one code, so users of the same face are gathered before they are
            // counted.
            while (begin < end) {
                const FaceRecord& face = records[keys_[begin].index];
                std::size_t sameEnd = begin + 1;
                for (std::size_t i = sameEnd; i < end; ++i)
                    if (records[keys_[i].index].sameFace(face)) std::swap(keys_[i], keys_[sameEnd++]);
                resolve(records, begin, sameEnd);
                begin = sameEnd;
            }
        }
    }

  private:
    static constexpr int kDigitBits = 11;
    static constexpr std::size_t kDigits = std::size_t(1) << kDigitBits;

    struct Key {
        std::uint32_t code;   // low bits of the hash
        std::uint32_t index;  // of the record
    };

    /// Radix sort in two passes: no branches to predict, unlike a hash table or comparisons.
    void sortKeys(std::span<const FaceRecord> records) {
        const std::size_t count = records.size();
        keys_.resize(count);
        sorted_.resize(count);
        std::array<std::uint32_t, kDigits> low{}, high{};
        for (std::size_t i = 0; i < count; ++i) {
            const auto code = std::uint32_t(records[i].hash() & (kDigits * kDigits - 1));
            keys_[i] = {code, std::uint32_t(i)};
            ++low[code % kDigits];
            ++high[code / kDigits];
        }
        std::uint32_t lowSum = 0, highSum = 0;
        for (std::size_t d = 0; d < kDigits; ++d) {
            lowSum += std::exchange(low[d], lowSum);
            highSum += std::exchange(high[d], highSum);
        }
        for (const Key& key : keys_) sorted_[low[key.code % kDigits]++] = key;
        for (const Key& key : sorted_) keys_[high[key.code / kDigits]++] = key;
    }

    /// Counts one face, whose users are keys [begin, end). Sets bit f of an element for a boundary face, bit
    /// 4 + f too when the face is lone.
    void resolve(std::span<const FaceRecord> records, std::size_t begin, std::size_t end) {
        const std::size_t users = end - begin;
        (users == 1 ? counts.single : users == 2 ? counts.paired : counts.crowded) += 1;
        int solidUsers = 0, largest[2] = {0, 0};
        std::uint32_t solid = 0;
        for (std::size_t i = begin; i < end; ++i) {
            const FaceRecord& record = records[keys_[i].index];
            largest[record.middle & 1] += record.oppositeIsLargest();
            if (record.isFlat()) continue;
            ++solidUsers;
            solid = record.id;
        }
        if (largest[0] > 1 || largest[1] > 1) countDuplicates(records, begin, end);
        if (solidUsers != 1) return;
        const unsigned bits = (users == 1 ? 0x11u : 0x1u) << (solid % 4);
        std::atomic_ref(isBoundary_[solid / 4]).fetch_or(std::uint8_t(bits), std::memory_order_relaxed);
    }

    /// Two elements with the same four nodes meet at exactly one face with their largest node opposite.
    void countDuplicates(std::span<const FaceRecord> records, std::size_t begin, std::size_t end) {
        opposites_.clear();
        for (std::size_t i = begin; i < end; ++i) {
            const FaceRecord& record = records[keys_[i].index];
            if (record.oppositeIsLargest()) opposites_.push_back(mesh_.tets[record.id / 4][record.id % 4]);
        }
        std::sort(opposites_.begin(), opposites_.end());
        counts.duplicate += opposites_.end() - std::unique(opposites_.begin(), opposites_.end());
    }

    const TetMesh& mesh_;
    std::vector<std::uint8_t>& isBoundary_;
    std::vector<Key> keys_, sorted_;
    std::vector<std::int32_t> opposites_;
};

std::vector<BoundaryFace> collectFaces(const TetMesh& mesh, const std::vector<std::uint8_t>& isBoundary,
                                       std::size_t firstBit) {
    std::vector<BoundaryFace> faces;
    for (std::size_t e = 0; e < isBoundary.size(); ++e) {
        if (!isBoundary[e]) continue;
        for (std::size_t f = 0; f < 4; ++f) {
            if (!(isBoundary[e] >> (firstBit + f) & 1)) continue;
            const auto& tet = mesh.tets[e];
            faces.push_back(
                {std::int32_t(e), {tet[kFaceNodes[f][0]], tet[kFaceNodes[f][1]], tet[kFaceNodes[f][2]]}});
        }
    }
    return faces;
}

void checkFlags(const TetMesh& mesh, std::span<const std::uint8_t> flat) {
    TESSERA_CHECK(flat.size() == mesh.tets.size(), "one flag an element");
    TESSERA_CHECK(mesh.elementCount() < (std::int64_t(1) << 30), "at most 2^30 elements");
}

/// Calls look(matcher) for the matchers of all buckets, once each; they set the bits of elements.
template <class Look>
void matchBuckets(const TetMesh& mesh, const FaceBuckets& buckets, std::vector<std::uint8_t>& isBoundary,
                  const Execution& execution, const Look& look) {
    parallelForChunks(execution, buckets.count(), 8, [&](std::int64_t first, std::int64_t last) {
        BucketMatcher matcher(mesh, isBoundary);
        for (std::int64_t b = first; b < last; ++b)
            matcher.match({buckets.records.get() + buckets.begin[std::size_t(b)],
                           buckets.records.get() + buckets.begin[std::size_t(b) + 1]});
        look(matcher);
    });
}

}  // namespace

std::vector<BoundaryFace> matchBoundary(const TetMesh& mesh, std::span<const std::uint8_t> flat,
                                        const Execution& execution) {
    checkFlags(mesh, flat);
    // The faces of which a node is the smallest, each as a number, exclusive or: 0 where each of them has an
    // even number of elements that aren't flat. Then none is on the boundary, but for one chance in 2^64.
    std::vector<std::uint64_t> odd(mesh.points.size(), 0);
    parallelForChunks(execution, mesh.elementCount(), kElementChunk,
                      [&](std::int64_t begin, std::int64_t end) {
                          for (std::int64_t e = begin; e < end; ++e) {
                              if (flat[std::size_t(e)]) continue;
                              for (std::size_t f = 0; f < 4; ++f) {
                                  const FaceRecord record = recordOf(mesh.tets[std::size_t(e)], e, f, false);
                                  std::atomic_ref(odd[record.smallest / 2])
                                      .fetch_xor(record.hash(), std::memory_order_relaxed);
                              }
                          }
                      });
    const auto mayCount = [&](const FaceRecord& record) {
        return !record.isFlat() && odd[record.smallest / 2] != 0;
    };
    const FaceBuckets buckets = bucketFaces(mesh, flat, mesh.elementCount(), mayCount, execution);
    std::vector<std::uint8_t> isBoundary(mesh.tets.size(), 0);
    matchBuckets(mesh, buckets, isBoundary, execution, [](const BucketMatcher&) {});
    return collectFaces(mesh, isBoundary, 0);
}

FaceMatching matchFaces(const TetMesh& mesh, std::span<const std::uint8_t> flat, const Execution& execution) {
    checkFlags(mesh, flat);
    const auto all = [](const FaceRecord&) { return true; };
    const FaceBuckets buckets = bucketFaces(mesh, flat, 4 * mesh.elementCount(), all, execution);
    std::vector<std::uint8_t> isBoundary(mesh.tets.size(), 0);
    std::atomic<std::int64_t> single{0}, paired{0}, crowded{0}, duplicate{0};
    matchBuckets(mesh, buckets, isBoundary, execution, [&](const BucketMatcher& matcher) {
        single += matcher.counts.single;
        paired += matcher.counts.paired;
        crowded += matcher.counts.crowded;
        duplicate += matcher.counts.duplicate;
    });
    return {collectFaces(mesh, isBoundary, 0),
            collectFaces(mesh, isBoundary, 4),
            single,
            paired,
            crowded,
            duplicate};
}

}  // namespace tessera
