// Whose the points are that several elements cover, a thread a contender: orders are forgotten (STEP 0), the
// greatest is found (1), who came first and has it no longer goes (2), and of those that have it the one with
// the least rank is the owner (3).
// The order of an element at a point that it covers.
uint orderOfRank(uint rank, uvec3 point) {
    uint kind = rank >> kKindShift, item = rank & kPlaceMask;
    float depth;
    if (kind < 2u) {
        Geometry geometry = geometries[item];
        depth = depthAt(geometry.nx, geometry.ny, geometry.nz, geometry.offset,
                        vec3(point) - geometry.base.xyz);
    } else if (kind < 4u) {
        ThinGeometry geometry = thinGeometries[item];
        depth = float(depthAt(geometry.nx, geometry.ny, geometry.nz, geometry.offset,
                              vec3(point) - geometry.base.xyz));
    } else {
        depth = decided[item].depth;
    }
    return floatBitsToUint(orderOf(depth));
}

void main() {
    uint index = threadIndex();
    if (index >= contenderCount) return;
    Contender contender = contenders[index];
    uint at = contender.at;
#if STEP == 0
    orders[at] = 0u;
    uvec3 point = uvec3(at % regionSize.x, at / regionSize.x % regionSize.y, at / (regionSize.x * regionSize.y));
    contenders[index].first = orderOfRank(~contender.first, point);
#elif STEP == 1
    atomicMax(orders[at], max(contender.order, contender.first));
#elif STEP == 2
    if (contender.first < orders[at]) owners[at] = 0u;
#else
    if (contender.order == orders[at]) atomicMax(owners[at], ~contender.rank);
#endif
}
