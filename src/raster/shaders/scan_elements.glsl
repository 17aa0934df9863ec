// The points of boxes, a thread a box or a part of one.
layout(std430, binding = 5) readonly buffer Boxes {
    Box boxes[];
};
uniform uint firstBox, boxCount;
uniform uint partBits;  // of a box 2^this threads, as many as it has parts or more

// Narrows a box to its i-th part; false when it has no such part or surely no point of it lies in the element.
bool takePart(uint i, Geometry geometry, inout uvec3 low, inout uvec3 size) {
    uvec3 part = partSize(size), count = (size + part - 1u) / part;
    if (i >= count.x * count.y * count.z) return false;
    uvec3 from = uvec3(i % count.x, i / count.x % count.y, i / (count.x * count.y)) * part;
    low += from;
    size = min(part, size - from);
    const float kSurely = 1.0 / 64.0;  // far from rounding
    vec3 lowest = vec3(low) - geometry.base.xyz, highest = lowest + vec3(size - 1u);
    Real4 most = geometry.offset + Real(geometry.base.w) + Real(kSurely);
    most += max(geometry.nx * Real(lowest.x), geometry.nx * Real(highest.x));
    most += max(geometry.ny * Real(lowest.y), geometry.ny * Real(highest.y));
    most += max(geometry.nz * Real(lowest.z), geometry.nz * Real(highest.z));
    return all(greaterThanEqual(most, Real4(0)));
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
    if (index >> partBits >= boxCount) return;
    Box box = boxes[firstBox + (index >> partBits)];
    Geometry geometry = geometries[box.rank & kPlaceMask];
    uvec3 low = unpack(box.low), size = unpack(box.last) - low + 1u;
    if (partBits != 0u && !takePart(index & ((1u << partBits) - 1u), geometry, low, size)) return;
    uint count = size.x * size.y * size.z;
    float ofRow = 1.0 / float(size.x), ofLayer = 1.0 / float(size.x * size.y);
    for (uint first = 0u; first < count; first += 32u) {
        // Which of 32 points are covered is found without memory; only those are noted.
        uint covered = 0u, contested = 0u, some = min(32u, count - first);
        for (uint b = 0u; b < some; ++b) {
            Real depth = depthIn(geometry, low + placeInBox(first + b, size, ofRow, ofLayer));
            covered |= uint(depth >= -Real(geometry.base.w)) << b;
        }
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
