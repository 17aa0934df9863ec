// Marks the elements that may have points in the region, a thread an element: by rounded places, and so some more.
layout(std430, binding = 0) readonly buffer Tets {
    uvec4 tets[];
};
layout(std430, binding = 1) readonly buffer Rough {
    vec4 rough[];
};
layout(std430, binding = 2) buffer Marks {
    uint marks[];  // a bit an element
};
uniform uint elementCount;
uniform vec3 lowest, highest;  // points of the region

void main() {
    uint element = threadIndex();
    if (element >= elementCount) return;
    uvec4 tet = tets[element];
    vec3 a = rough[tet.x & ~(1u << 31)].xyz, b = rough[tet.y].xyz, c = rough[tet.z].xyz, d = rough[tet.w].xyz;
    vec3 low = min(min(a, b), min(c, d)), high = max(max(a, b), max(c, d));
    // Twice the rounding of a place, and of the bounds.
    vec3 room = max(max(abs(low), abs(high)), max(abs(lowest), abs(highest))) * ROUGH + MARGIN;
    low = max(ceil(low - room), lowest);
    high = min(floor(high + room), highest);
    // False for what isn't a number.
    if (all(lessThanEqual(low, high)) && all(lessThan(abs(a + b + c + d), vec3(1e30))))
        atomicOr(marks[element >> 5], 1u << (element & 31u));
}
