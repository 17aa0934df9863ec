// Boxes of elements.
struct Box {
    uint rank;
    uint low, last;  // points of the region, 8 bits an axis
};

uvec3 unpack(uint place) {
    return uvec3(place, place >> 8, place >> 16) & 0xffu;
}
uint pack(uvec3 place) {
    return place.x | place.y << 8 | place.z << 16;
}
// The parts that a box is cut into, by their largest size.
uvec3 partSize(uvec3 size) {
    uvec3 part = size;
    while (part.x * part.y * part.z > PART_POINTS) {
        if (part.z >= part.x && part.z >= part.y)
            part.z = (part.z + 1u) / 2u;
        else if (part.y >= part.x)
            part.y = (part.y + 1u) / 2u;
        else
            part.x = (part.x + 1u) / 2u;
    }
    return part;
}
