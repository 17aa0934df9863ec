// Marks the elements that may have points in the region, a thread for each that is looked at: by rounded places, and
// so some more.
layout(std430, binding = 0) readonly buffer Tets {
    uvec4 tets[];
};
layout(std430, binding = 1) readonly buffer Rough {
    vec4 rough[];
};
layout(std430, binding = 2) buffer Marks {
    uint marks[];  // a bit for each that is looked at
};
uniform uint itemCount;
uniform vec3 lowest, highest;  // points of the region

// True when the element surely covers none of the eight points that follow the first: by the bound in
// src/index_space/near_kernel.cpp, and for points that may lie MARGIN outside it, 14 extent^2 MARGIN.
bool liesBetween(vec3 n0, vec3 n1, vec3 n2, vec3 n3, vec3 first, float extent, float farthest) {
    if (extent > 64.0) return false;  // may overflow
    vec3 toFirst = first - n0, a = n1 - n0, b = n2 - n0, c = n3 - n0;
    vec3 normal1 = cross(b, c), normal2 = cross(c, a), normal3 = cross(a, b);
    float volume = dot(a, normal1);
    float error = extent * extent * (ROUGH_ERROR * (farthest + 2.0) + 4.0 * ROUGH_ERROR * extent + 16.0 * MARGIN);
    if (!(abs(volume) > error)) return false;
    float turn = volume < 0.0 ? -1.0 : 1.0;
    mat3x4 normals = mat3x4(0);
    vec4 shares;
    vec3 sum = normal1 + normal2 + normal3;
    for (int axis = 0; axis < 3; ++axis)
        normals[axis] = turn * vec4(-sum[axis], normal1[axis], normal2[axis], normal3[axis]);
    shares = normals[0] * toFirst.x + normals[1] * toFirst.y + normals[2] * toFirst.z;
    shares.x += abs(volume);
    float most = -1e30;
    for (int i = 0; i < 8; ++i) {
        vec4 at = shares + normals[0] * float(i & 1) + normals[1] * float(i >> 1 & 1) + normals[2] * float(i >> 2);
        most = max(most, min(min(at.x, at.y), min(at.z, at.w)));
    }
    return most < -error;
}

void main() {
    uint item = threadIndex();
    if (item >= itemCount) return;
    uvec4 tet = tets[elementOf(item)];
    vec4 ofA = rough[tet.x & ~DECIDED_BIT], ofB = rough[tet.y], ofC = rough[tet.z], ofD = rough[tet.w];
    if (ofA.w + ofB.w + ofC.w + ofD.w > 0.0) return;
    vec3 a = ofA.xyz, b = ofB.xyz, c = ofC.xyz, d = ofD.xyz;
    vec3 low = min(min(a, b), min(c, d)), high = max(max(a, b), max(c, d));
    // Twice the rounding of a place, and of the bounds.
    vec3 room = max(max(abs(low), abs(high)), max(abs(lowest), abs(highest))) * ROUGH + MARGIN;
    vec3 sizes = high - low, far = max(abs(low), abs(high));
    float extent = max(max(sizes.x, sizes.y), sizes.z), farthest = max(max(far.x, far.y), far.z);
    low = max(ceil(low - room), lowest);
    high = min(floor(high + room), highest);
    if (!all(lessThanEqual(low, high))) return;
    if (all(lessThanEqual(high, low + 1.0)) && liesBetween(a, b, c, d, low, extent, farthest)) return;
    atomicOr(marks[item >> 5], 1u << (item & 31u));
}
