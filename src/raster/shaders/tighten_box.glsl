// Shrinks the box of an element with few points to those that it may cover; false when there are none.
// `end` is not in the box.
bool tightenBox(Geometry geometry, inout ivec3 low, inout ivec3 end) {
    const int kMostTightened = 216;
    ivec3 size = end - low;
    if (size.x * size.y * size.z > kMostTightened) return true;
    vec3 corner = vec3(low) - geometry.base.xyz;
    vec4 atCorner = geometry.nx * corner.x + geometry.ny * corner.y + geometry.nz * corner.z + geometry.offset +
                    geometry.base.w + kSurely;
    ivec3 kept = size, keptEnd = ivec3(0);
    for (int z = 0; z < size.z; ++z)
        for (int y = 0; y < size.y; ++y) {
            vec2 row = rowWithin(atCorner + geometry.ny * float(y) + geometry.nz * float(z), geometry.nx,
                                 float(size.x - 1));
            if (row.x > row.y) continue;
            kept = min(kept, ivec3(int(row.x), y, z));
            keptEnd = max(keptEnd, ivec3(int(row.y), y, z) + 1);
        }
    end = low + keptEnd;
    low += kept;
    return keptEnd.x > 0;
}
