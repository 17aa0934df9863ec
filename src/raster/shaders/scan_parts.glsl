// Cuts larger boxes into parts, a thread a part, and lists those in which the element may have points.
layout(std430, binding = 5) readonly buffer Boxes {
    Box boxes[];
};
uniform uint firstBox, boxCount;
layout(std430, binding = 6) writeonly buffer Parts {
    Box parts[];
};
uniform uint partsABox;  // as many or more
uniform uint chunk;

// True when no point of the part lies in the element; far from rounding.
bool isOutside(Geometry geometry, uvec3 low, uvec3 last) {
    const float kSurely = 1.0 / 64.0;
    vec3 lowest = vec3(low) - geometry.base.xyz, highest = vec3(last) - geometry.base.xyz;
    Real4 most = geometry.offset + Real(geometry.base.w) + Real(kSurely);
    most += max(geometry.nx * Real(lowest.x), geometry.nx * Real(highest.x));
    most += max(geometry.ny * Real(lowest.y), geometry.ny * Real(highest.y));
    most += max(geometry.nz * Real(lowest.z), geometry.nz * Real(highest.z));
    return any(lessThan(most, Real4(0)));
}

void main() {
    uint index = threadIndex();
    if (index == 0u) clearPartCount((chunk + 1u) & 1u);
    if (index / partsABox >= boxCount) return;
    Box box = boxes[firstBox + index / partsABox];
    uvec3 low = unpack(box.low), size = unpack(box.last) - low + 1u, part = partSize(size);
    uvec3 count = (size + part - 1u) / part;
    uint i = index % partsABox;
    if (i >= count.x * count.y * count.z) return;
    uvec3 first = low + uvec3(i % count.x, i / count.x % count.y, i / (count.x * count.y)) * part;
    uvec3 last = min(first + part, low + size) - 1u;
    if (isOutside(geometries[box.rank & kPlaceMask], first, last)) return;
    uint slot = atomicAdd(partCounts[chunk & 1u].parts, 1u);
    parts[slot] = Box(box.rank, pack(first), pack(last));
    if (slot % GROUP_THREADS == 0u) atomicAdd(partCounts[chunk & 1u].groups[0], 1u);
}
