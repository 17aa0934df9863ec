// The points of the boxes of elements, a thread a box.
struct Box {
    uint rank;
    uint low, last;  // points of the region, 8 bits an axis
};
layout(std430, binding = 5) readonly buffer Boxes {
    Box boxes[];
};
// WORDS of 32 points a box, which the first way leaves for the others.
layout(std430, binding = 4) buffer CoveredPoints {
    uint coveredPoints[];
};
uniform uint firstBox, boxCount;

uvec3 unpack(uint place) {
    return uvec3(place, place >> 8, place >> 16) & 0xffu;
}

// The i-th point of a box of at most 2^10 points; the reciprocals are those of a row's and a layer's count.
uvec3 placeInBox(uint i, uvec3 size, float ofRow, float ofLayer) {
    uint z = uint((float(i) + 0.5) * ofLayer);
    uint inLayer = i - z * size.x * size.y;
    uint y = uint((float(inLayer) + 0.5) * ofRow);
    return uvec3(inLayer - y * size.x, y, z);
}
Real depthIn(Geometry geometry, uvec3 point) {
    return depthAt(geometry.nx, geometry.ny, geometry.nz, geometry.offset, vec3(point) - geometry.base.xyz);
}

void main() {
    uint index = threadIndex();
    if (index >= boxCount) return;
    Box box = boxes[firstBox + index];
    Geometry geometry = geometries[box.rank & kPlaceMask];
    uvec3 low = unpack(box.low), size = unpack(box.last) - low + 1u;
    uint count = size.x * size.y * size.z;
    float ofRow = 1.0 / float(size.x), ofLayer = 1.0 / float(size.x * size.y);
    for (uint first = 0u; first < count; first += 32u) {
        uint word = (firstBox + index) * WORDS + first / 32u;
        // Which of 32 points are covered is found without memory; only those are noted.
#if defined(ORDERS) || defined(RANKS)
        uint covered = coveredPoints[word];
#else
        uint covered = 0u, some = min(32u, count - first);
        for (uint b = 0u; b < some; ++b) {
            Real depth = depthIn(geometry, low + placeInBox(first + b, size, ofRow, ofLayer));
            covered |= uint(depth >= -Real(geometry.base.w)) << b;
        }
        coveredPoints[word] = covered;
#endif
        uint contested = 0u;
        for (uint left = covered; left != 0u; left &= left - 1u) {
            uvec3 point = low + placeInBox(first + uint(findLSB(left)), size, ofRow, ofLayer);
#if defined(ORDERS)
            noteOrder(placeOf(point), orderOf(float(depthIn(geometry, point))));
#elif defined(RANKS)
            noteRank(placeOf(point), orderOf(float(depthIn(geometry, point))), box.rank);
#else
            if (takeFirst(placeOf(point), box.rank) != 0u) contested |= left & -left;
#endif
        }
        for (; contested != 0u; contested &= contested - 1u) {
            uvec3 point = low + placeInBox(first + uint(findLSB(contested)), size, ofRow, ofLayer);
            // Whoever came first stays until all have come.
            contend(placeOf(point), orderOf(float(depthIn(geometry, point))), box.rank,
                    atomicOr(owners[placeOf(point)], 0u));
        }
    }
}
