// The nodes of an element relative to its first voxel, as src/raster/element_shape.cpp places them.
layout(std430, binding = 0) readonly buffer Tets {
    uvec4 tets[];  // DECIDED_BIT in x: the processor decides
};
layout(std430, binding = 1) readonly buffer Frame {
    double frame[];  // the whole voxels of x, y, z, and the rest
};

struct Placed {
    dvec3 first;
    dvec3 node[4];
    dvec3 low, high;
};

Placed placeNodes(uvec4 tet) {
    dvec3 whole[4], part[4];
    for (int k = 0; k < 4; ++k) {
        uint at = 6u * tet[k];
        whole[k] = dvec3(frame[at], frame[at + 1u], frame[at + 2u]);
        part[k] = dvec3(frame[at + 3u], frame[at + 4u], frame[at + 5u]);
    }
    Placed placed;
    dvec3 first = min(min(whole[0], whole[1]), min(whole[2], whole[3]));
    placed.first = clamp(first, dvec3(-2147483648.0LF), dvec3(2147483647.0LF));
    for (int k = 0; k < 4; ++k) {
        precise dvec3 node = (whole[k] - first) + part[k];
        placed.node[k] = node;
    }
    placed.low = min(min(placed.node[0], placed.node[1]), min(placed.node[2], placed.node[3]));
    placed.high = max(max(placed.node[0], placed.node[1]), max(placed.node[2], placed.node[3]));
    return placed;
}

// Points of the region in the element's bounding box, widened by `room`; relative to the region's first point.
// Empty where they end before they begin.
uniform ivec3 regionMin, regionSize;
void pointsAbout(Placed placed, double room, out ivec3 low, out ivec3 end) {
    precise dvec3 lowest = placed.first + ceil(placed.low - room) - dvec3(regionMin);
    precise dvec3 highest = placed.first + floor(placed.high + room) - dvec3(regionMin);
    low = ivec3(clamp(lowest, dvec3(0), dvec3(regionSize)));
    end = ivec3(clamp(highest + 1.0LF, dvec3(0), dvec3(regionSize)));
}
