// Marks the elements that may have points in the region, a thread an element.
layout(std430, binding = 2) buffer Marks {
    uint marks[];  // a bit an element
};
uniform uint elementCount;

void main() {
    uint element = threadIndex();
    if (element >= elementCount) return;
    uvec4 tet = tets[element];
    tet.x &= ~kDecidedBit;
    Placed placed = placeNodes(tet);
    precise dvec3 sum = placed.node[0] + placed.node[1] + placed.node[2] + placed.node[3];
    if (any(isnan(sum)) || any(isinf(sum))) return;
    ivec3 low, end;
    pointsAbout(placed, BOX_SLACK + LARGEST_MARGIN, low, end);
    if (all(lessThan(low, end))) atomicOr(marks[element >> 5], 1u << (element & 31u));
}
