// The owner of a point of the region, as the complement of its rank. 0: no element covers it.
layout(std430, binding = 3) buffer Owners {
    uint owners[];
};
// The greatest order at a point, where several elements cover it.
layout(std430, binding = 2) buffer Orders {
    uint orders[];
};
uniform uvec3 regionSize;

// Those who come to a point that has an owner already, and the complement of that one's rank or, later, its
// order.
struct Contender {
    uint at, order, rank, first;
};
layout(std430, binding = 7) buffer Contenders {
    volatile uint contenderCount;  // may be more than there is room for
    uint unused[3];
    Contender contenders[];
};
uniform uint contenderRoom;

uint placeOf(uvec3 point) {
    return (point.z * regionSize.y + point.y) * regionSize.x + point.x;
}

// Gives 0 to the first to come, who owns the point; to others, who contend for it, that one's complement.
uint takeFirst(uint at, uint rank) {
    return atomicCompSwap(owners[at], 0u, ~rank);
}
void contend(uint at, float order, uint rank, uint first) {
    if (contenderCount > contenderRoom) return;  // nor may the count come round
    uint slot = atomicAdd(contenderCount, 1u);
    if (slot < contenderRoom) contenders[slot] = Contender(at, floatBitsToUint(order), rank, first);
}
// The way that needs no list: the greatest orders of all, then the least ranks.
void noteOrder(uint at, float order) {
    atomicMax(orders[at], floatBitsToUint(order));
}
void noteRank(uint at, float order, uint rank) {
    if (orders[at] == floatBitsToUint(order)) atomicMax(owners[at], ~rank);
}
