// What a scan notes of a point of the region: the greatest order, and of those that have it the least rank, as
// its complement. 0, 0: no element covers it.
struct Mark {
    uint order, rank;
};
layout(std430, binding = 3) buffer Marks {
    Mark marks[];
};
uniform uvec3 regionSize;

// Those who come to a point that has an owner already; `firstOrder` is that of the first who came.
struct Contender {
    uint at, order, rank, firstOrder;
};
layout(std430, binding = 7) buffer Contenders {
    uint contenderCount;  // may be more than there is room for
    uint unused[3];
    Contender contenders[];
};
uniform uint contenderRoom;

// As src/raster/point_scan.h ranks the elements of a region: a kind in the highest bits.
const uint kKindShift = 28u;
const uint kPlaceMask = (1u << kKindShift) - 1u;

uint markOf(uvec3 point) {
    return (point.z * regionSize.y + point.y) * regionSize.x + point.x;
}

// The first to come owns a point; false for others, who contend for it.
bool takeFirst(uint at, float order, uint rank) {
    bool isFirst = atomicCompSwap(marks[at].order, 0u, floatBitsToUint(order)) == 0u;
    if (isFirst) marks[at].rank = ~rank;
    return isFirst;
}
void contend(uint at, float order, uint rank) {
    if (contenderCount > contenderRoom) return;  // nor may the count come round
    uint slot = atomicAdd(contenderCount, 1u);
    if (slot < contenderRoom)
        contenders[slot] = Contender(at, floatBitsToUint(order), rank, marks[at].order);
}
// The way that needs no list: the greatest orders of all, then the least ranks.
void noteOrder(uint at, float order) {
    atomicMax(marks[at].order, floatBitsToUint(order));
}
void noteRank(uint at, float order, uint rank) {
    if (marks[at].order == floatBitsToUint(order)) atomicMax(marks[at].rank, ~rank);
}
