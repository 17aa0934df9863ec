// Boxes of elements, or parts of them.
struct Box {
    uint rank;
    uint low, last;  // points of the region, 8 bits an axis
};
layout(std430, binding = 5) readonly buffer Boxes {
    Box boxes[];
};
uniform uint firstBox, boxCount;
uvec3 unpack(uint place) {
    return uvec3(place, place >> 8, place >> 16) & 0xffu;
}
uint pack(uvec3 place) {
    return place.x | place.y << 8 | place.z << 16;
}
