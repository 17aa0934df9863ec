// What stands for the elements of one kind in some layers, ascending, a thread an element: a sprite a layer of
// small elements, four corners of the large ones; with COUNTS only how many there are. The algorithm's shader says
// which pixels an element may cover.
layout(std430, binding = 2) readonly buffer Listed {
    uint listed[];
};
layout(std430, binding = 3) readonly buffer Boxes {
    Box boxes[];
};
layout(std430, binding = 4) readonly buffer Slots {
    uint slots[];  // where elements that are drawn stand in the list
};
#ifdef COUNTS
layout(std430, binding = 5) writeonly buffer Counts {
    uint counts[];
};
#else
layout(std430, binding = 5) readonly buffer Sums {
    uint sums[];  // where an element's primitives begin
};
#ifdef LARGE
layout(std430, binding = 6) writeonly buffer Corners {
    uvec4 corners[];  // s, t: float; record, layer
};
#else
layout(std430, binding = 6) writeonly buffer Sprites {
    uint sprites[];  // record; s, t; layer, edge: 16 bits each
};
#endif
#endif
uniform uint elementCount;

#ifdef LARGE
// A convex polygon moves outwards by `growth` on all sides; false when a corner is too sharp for that.
bool grow(inout vec2 corner[4], int count, float growth) {
    const float kLongestMiter = 0.125, kLeastSine = 1.0 / 4096.0;
    // Steps are always four, so that compilers unroll them.
    vec2 direction[4], moved[4];
    bool isGrown = true;
    for (int k = 0; k < 4; ++k) {
        vec2 along = (k + 1 < count ? corner[(k + 1) & 3] : corner[0]) - corner[k];
        float size = length(along);
        isGrown = isGrown && (size > 1.0 / 1024.0 || k >= count);
        direction[k] = along / size;
    }
    float turnSign = 0.0;
    for (int k = 0; k < 4; ++k) {
        vec2 before = k > 0 ? direction[(k + 3) & 3] : count > 3 ? direction[3] : direction[2];
        vec2 after = direction[k];
        float turn = before.x * after.y - before.y * after.x;
        if (k == 0) turnSign = turn < 0.0 ? -1.0 : 1.0;
        float sine = turn * turnSign;
        moved[k] = growth / sine * (before - after);
        bool isShort = sine > kLeastSine && dot(moved[k], moved[k]) <= kLongestMiter * kLongestMiter;
        isGrown = isGrown && (isShort || k >= count);
    }
    for (int k = 0; k < 4; ++k)
        if (isGrown) corner[k] += moved[k];
    if (isGrown && count < 4) corner[3] = corner[2];
    return isGrown;
}

#endif

void main() {
    uint index = threadIndex();
    if (index >= elementCount) return;
#ifdef COUNTS
    counts[index] = 0u;
#endif
    uint slot = slots[index];
    if (slot == kNoSlot) return;
    Box box = boxes[slot];
    uvec3 low = unpack(box.low), last = unpack(box.last);
    uvec2 within = layersOf(box);
    ivec4 all = ivec4(low[axes.x], low[axes.y], last[axes.x], last[axes.y]);
    uint record = box.rank & kPlaceMask;
#ifdef COUNTS
    uint to = 0u;
#else
    uint to = sums[index];
#endif
#ifdef LARGE
#ifdef COUNTS
    to = within.y - within.x;
#else
    begin(placeNodes(tets[listed[slot]]));
    for (uint layer = within.x; layer < within.y; ++layer, ++to) {
        ivec4 rect = all;
        vec2 corner[4];
        float growth = GROWTH;
        int count = cornersIn(layer, corner, growth, rect);
        if (count < 3 || !grow(corner, count, growth)) {
            ivec2 end = rect.zw + 1;
            corner = vec2[4](vec2(rect.xy), vec2(end.x, rect.y), vec2(end), vec2(rect.x, end.y));
        }
        bool isEmpty = any(greaterThan(rect.xy, rect.zw));
        for (int k = 0; k < 4; ++k)
            corners[4u * to + uint(k)] = uvec4(floatBitsToUint(isEmpty ? vec2(0) : corner[k]), record, layer);
    }
#endif
#else
    begin(geometries[record], all);
    for (uint layer = within.x; layer < within.y; ++layer) {
        ivec4 rect = all;
        rectIn(layer, rect);
        ivec2 size = rect.zw - rect.xy + 1;
        if (min(size.x, size.y) <= 0) continue;
#ifndef COUNTS
        sprites[3u * to] = record;
        sprites[3u * to + 1u] = uint(rect.x) | uint(rect.y) << 16;
        sprites[3u * to + 2u] = layer | uint(max(size.x, size.y)) << 16;
#endif
        ++to;
    }
#endif
#ifdef COUNTS
    counts[index] = to;
#endif
}
