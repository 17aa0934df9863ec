// Records of the listed elements' geometry and their boxes, a thread an element: of easy elements where they stand
// in the list, and with THIN those of thin ones, ascending.
layout(std430, binding = 2) readonly buffer Listed {
    uint listed[];
};
layout(std430, binding = 3) writeonly buffer Geometries {
    Geometry geometries[];
};
layout(std430, binding = 4) buffer Boxes {
    Box boxes[];
};
layout(std430, binding = 5) buffer ThinMarks {
    uint thinMarks[];
};
#ifdef THIN
layout(std430, binding = 6) readonly buffer ThinSums {
    uint thinSums[];
};
layout(std430, binding = 7) writeonly buffer ThinSlots {
    uint thinSlots[];  // where thin elements stand in the list
};
#else
// Of each bucket that a scan sorts boxes into; with DRAWN, of each kind of elements and each layer: those that begin
// there, less those that ended before; and behind them the layers that elements reach but have no points in.
layout(std430, binding = 6) buffer BoxCounts {
    uint boxCounts[];
};
uniform uint layerAxis;
layout(std430, binding = 7) buffer HardElements {
    uint hardCount;
    uint hard[];
};
#endif
uniform uint listedCount;

Geometry recordOf(Placed placed, Shape shape) {
    dvec3 base = baseOf(placed);
    Real4 nx, ny, nz, offset;
    for (int face = 0; face < 4; ++face) {
        dvec3 n = shape.normal[face];
        nx[face] = Real(n.x);
        ny[face] = Real(n.y);
        nz[face] = Real(n.z);
        offset[face] = Real(offsetAt(shape, face, base));
    }
    precise dvec3 place = placed.first + base - dvec3(regionMin);
    precise float slack = float(shape.slack) * SLACK_FACTOR;
    return Geometry(nx, ny, nz, offset, vec4(vec3(place), slack));
}

#ifdef THIN
void main() {
    uint slot = threadIndex(), word = slot >> 5, bit = 1u << (slot & 31u);
    if (slot >= listedCount || (thinMarks[word] & bit) == 0u) return;
    uint to = thinSums[word] + uint(bitCount(thinMarks[word] & (bit - 1u)));
    Placed placed = placeNodes(tets[listed[slot]]);
    geometries[to] = recordOf(placed, shapeElement(placed));
    boxes[slot].rank = (boxes[slot].rank & ~kPlaceMask) | to;
    thinSlots[to] = slot;
}
#else
void main() {
    uint slot = threadIndex();
    if (slot >= listedCount) return;
    uint element = listed[slot];
    uvec4 tet = tets[element];
    boxes[slot].rank = kNoBox;
    bool isDecided = (tet.x & DECIDED_BIT) != 0u;
    tet.x &= ~DECIDED_BIT;
    Placed placed = placeNodes(tet);
    Shape shape = shapeElement(placed);
    ivec3 low, end;
    pointsAbout(placed, BOX_SLACK + shape.margin, low, end);
    if (!all(lessThan(low, end))) return;
    if (isDecided || shape.grade == kHard) {
        hard[atomicAdd(hardCount, 1u)] = element;
        return;
    }
    Geometry geometry = recordOf(placed, shape);
#ifdef DRAWN
    int reached = end[layerAxis] - low[layerAxis];
    bool mayCover = tightenBox(geometry, low, end);
    int left = mayCover ? end[layerAxis] - low[layerAxis] : 0;
    if (left < reached) atomicAdd(boxCounts[KINDS * LAYERS + slot % EMPTY_COUNTERS], uint(reached - left));
    if (!mayCover) return;
#endif
    bool isSmall = all(lessThanEqual(placed.high - placed.low, dvec3(SMALL_EXTENT)));
    uint kind = (shape.grade == kThin ? 2u : 0u) + (isSmall ? 0u : 1u);
    Box box = Box(kind << kKindShift | slot, pack(uvec3(low)), pack(uvec3(end - 1)));
    boxes[slot] = box;
#ifdef DRAWN
    atomicAdd(boxCounts[kind * LAYERS + uint(low[layerAxis])], 1u);
    atomicAdd(boxCounts[kind * LAYERS + uint(end[layerAxis])], ~0u);
#else
    atomicAdd(boxCounts[bucketOf(box)], 1u);
#endif
    if (shape.grade == kThin)
        atomicOr(thinMarks[slot >> 5], 1u << (slot & 31u));
    else
        geometries[slot] = geometry;
}
#endif
