#include "mesh/face_matching.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>

#include "base/error.h"

namespace tessera {

namespace {

/// Nodes of the face opposite to local node f, seen counter-clockwise from outside when the volume is positive.
constexpr std::array<std::array<std::size_t, 3>, 4> kFaceNodes{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

constexpr std::int64_t kElementChunk = 1 << 15;
constexpr std::int64_t kNodeChunk = 1 << 12;

/// A face in the bucket of its smallest node.
struct FaceRecord {
    std::uint32_t middle;    // middle node
    std::uint32_t largest;   // 2 * largest node + (1 when the opposite node of the element is larger still)
    std::uint32_t id;        // 4 * element + local index of the opposite node

    std::uint64_t key() const { return std::uint64_t(middle) << 32 | (largest & ~1u); }
    bool oppositeIsLargest() const { return largest & 1; }
    bool operator<(const FaceRecord& other) const {
        return key() != other.key() ? key() < other.key() : id < other.id;
    }
};

std::array<std::int32_t, 3> sortedFace(const std::array<std::int32_t, 4>& tet, std::size_t f) {
    std::int32_t a = tet[kFaceNodes[f][0]], b = tet[kFaceNodes[f][1]], c = tet[kFaceNodes[f][2]];
    if (a > b) std::swap(a, b);
    if (b > c) std::swap(b, c);
    if (a > b) std::swap(a, b);
    return {a, b, c};
}

/// All faces, sorted into buckets by their smallest node.
struct FaceBuckets {
    std::vector<std::int64_t> begin;   // nodeCount + 1
    std::vector<FaceRecord> records;
};

FaceBuckets bucketFaces(const TetMesh& mesh, const Execution& execution) {
    const std::int64_t nodes = mesh.nodeCount();
    std::vector<std::uint32_t> cursor(std::size_t(nodes), 0);
    parallelForChunks(execution, mesh.elementCount(), kElementChunk, [&](std::int64_t first, std::int64_t last) {
        for (std::int64_t e = first; e < last; ++e) {
            // Three faces hold the smallest node; the fourth has the second smallest.
            std::array<std::int32_t, 4> t = mesh.tets[std::size_t(e)];
            if (t[0] > t[1]) std::swap(t[0], t[1]);
            if (t[2] > t[3]) std::swap(t[2], t[3]);
            const std::int32_t smallest = std::min(t[0], t[2]);
            const std::int32_t second = t[0] <= t[2] ? std::min(t[1], t[2]) : std::min(t[0], t[3]);
            std::atomic_ref(cursor[std::size_t(smallest)]).fetch_add(3, std::memory_order_relaxed);
            std::atomic_ref(cursor[std::size_t(second)]).fetch_add(1, std::memory_order_relaxed);
        }
    });
    FaceBuckets buckets;
    buckets.begin.resize(std::size_t(nodes) + 1);
    std::uint32_t total = 0;
    for (std::int64_t n = 0; n < nodes; ++n) {
        const std::uint32_t count = cursor[std::size_t(n)];
        buckets.begin[std::size_t(n)] = total;
        cursor[std::size_t(n)] = total;
        total += count;
    }
    buckets.begin[std::size_t(nodes)] = total;
    buckets.records.resize(total);
    parallelForChunks(execution, mesh.elementCount(), kElementChunk, [&](std::int64_t first, std::int64_t last) {
        for (std::int64_t e = first; e < last; ++e) {
            const auto& tet = mesh.tets[std::size_t(e)];
            for (std::size_t f = 0; f < 4; ++f) {
                const auto face = sortedFace(tet, f);
                const std::uint32_t place =
                    std::atomic_ref(cursor[std::size_t(face[0])]).fetch_add(1, std::memory_order_relaxed);
                buckets.records[place] = {std::uint32_t(face[1]),
                                          std::uint32_t(face[2]) * 2 + (tet[f] > face[2] ? 1u : 0u),
                                          std::uint32_t(e) * 4 + std::uint32_t(f)};
            }
        }
    });
    return buckets;
}

void sortBucket(FaceRecord* begin, FaceRecord* end) {
    if (end - begin > 48) {
        std::sort(begin, end);
        return;
    }
    for (FaceRecord* i = begin + 1; i < end; ++i) {
        const FaceRecord record = *i;
        FaceRecord* place = i;
        for (; place > begin && record < place[-1]; --place) *place = place[-1];
        *place = record;
    }
}

struct Counts {
    std::int64_t single = 0, paired = 0, crowded = 0, duplicate = 0;
};

/// Elements among the users of one face that have the same fourth node, the largest of the four, as an earlier one. Two
/// elements with the same four nodes meet like this at exactly one of their faces.
std::int64_t countDuplicates(const TetMesh& mesh, const FaceRecord* begin, const FaceRecord* end) {
    std::int64_t duplicates = 0;
    for (const FaceRecord* i = begin + 1; i < end; ++i) {
        if (!i->oppositeIsLargest()) continue;
        const std::int32_t node = mesh.tets[i->id / 4][i->id % 4];
        for (const FaceRecord* j = begin; j < i; ++j) {
            if (j->oppositeIsLargest() && mesh.tets[j->id / 4][j->id % 4] == node) {
                ++duplicates;
                break;
            }
        }
    }
    return duplicates;
}

/// Matches the faces of one bucket. Sets bit f of an element for a boundary face, bit 4 + f too when the face is lone.
void matchBucket(const TetMesh& mesh, std::span<const std::uint8_t> flat, FaceRecord* begin, FaceRecord* end,
                 std::vector<std::uint8_t>& isBoundary, Counts& counts) {
    sortBucket(begin, end);
    for (const FaceRecord* run = begin; run < end;) {
        const FaceRecord* runEnd = run + 1;
        while (runEnd < end && runEnd->key() == run->key()) ++runEnd;
        const auto users = runEnd - run;
        (users == 1 ? counts.single : users == 2 ? counts.paired : counts.crowded) += 1;
        if (users > 1) counts.duplicate += countDuplicates(mesh, run, runEnd);
        const FaceRecord* user = nullptr;
        int solidUsers = 0;
        for (const FaceRecord* i = run; i < runEnd; ++i) {
            if (flat[i->id / 4]) continue;
            user = i;
            ++solidUsers;
        }
        if (solidUsers == 1) {
            const unsigned bits = (users == 1 ? 0x11u : 0x1u) << (user->id % 4);
            std::atomic_ref(isBoundary[user->id / 4]).fetch_or(std::uint8_t(bits), std::memory_order_relaxed);
        }
        run = runEnd;
    }
}

std::vector<BoundaryFace> collectFaces(const TetMesh& mesh, const std::vector<std::uint8_t>& isBoundary,
                                       std::size_t firstBit) {
    std::vector<BoundaryFace> faces;
    for (std::size_t e = 0; e < isBoundary.size(); ++e) {
        if (!isBoundary[e]) continue;
        for (std::size_t f = 0; f < 4; ++f) {
            if (!(isBoundary[e] >> (firstBit + f) & 1)) continue;
            const auto& tet = mesh.tets[e];
            faces.push_back({std::int32_t(e),
                             {tet[kFaceNodes[f][0]], tet[kFaceNodes[f][1]], tet[kFaceNodes[f][2]]}});
        }
    }
    return faces;
}

}  // namespace

FaceMatching matchFaces(const TetMesh& mesh, std::span<const std::uint8_t> flat, const Execution& execution) {
    TESSERA_CHECK(flat.size() == mesh.tets.size(), "one flag an element");
    TESSERA_CHECK(mesh.elementCount() < (std::int64_t(1) << 30), "at most 2^30 elements");
    FaceBuckets buckets = bucketFaces(mesh, execution);
    std::vector<std::uint8_t> isBoundary(mesh.tets.size(), 0);
    std::atomic<std::int64_t> single{0}, paired{0}, crowded{0}, duplicate{0};
    parallelForChunks(execution, mesh.nodeCount(), kNodeChunk, [&](std::int64_t first, std::int64_t last) {
        Counts counts;
        for (std::int64_t n = first; n < last; ++n)
            matchBucket(mesh, flat, buckets.records.data() + buckets.begin[std::size_t(n)],
                        buckets.records.data() + buckets.begin[std::size_t(n) + 1], isBoundary, counts);
        single += counts.single;
        paired += counts.paired;
        crowded += counts.crowded;
        duplicate += counts.duplicate;
    });
    return {collectFaces(mesh, isBoundary, 0), collectFaces(mesh, isBoundary, 4), single, paired, crowded, duplicate};
}

}  // namespace tessera
