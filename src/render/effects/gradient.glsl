// The slope of the codes, a voxel. Shared by the effects that need it.
uniform ivec3 slotsAlong;  // of an atlas
uniform int atlas;

// The code at a place that may lie beyond the brick, next to it; false where it isn't known.
bool codeNear(vec3 local, out float code) {
    ivec3 slotTexel = bricks[number].texel;
    bool isWhole = bricks[number].isWhole != 0;
    if (any(lessThan(local, vec3(0))) || any(greaterThan(local, vec3(CELLS)))) {
        int depth = bricks[number].depth;
        ivec3 index = bricks[number].index;
        vec3 place = (vec3(index & ((1 << depth) - 1)) + local / float(CELLS)) / float(1 << depth);
        vec3 root = floor(place);
        FoundBrick near = findBrick((index >> depth) + ivec3(root), place - root);
        int slots = slotsAlong.x * slotsAlong.y * slotsAlong.z;
        if (!near.isThere || int(near.slot) / slots != atlas) return false;
        isWhole = false;
        int slot = int(near.slot) % slots;
        slotTexel = ivec3(slot % slotsAlong.x, slot / slotsAlong.x % slotsAlong.y,
                          slot / (slotsAlong.x * slotsAlong.y)) * (CELLS + 1);
        local = near.inBrick * float(CELLS);
    }
    vec3 cell = clamp(floor(local), vec3(0), vec3(CELLS - 1));
    ivec3 texel = slotTexel + ivec3(cell);
    float corners[8];
    for (int c = 0; c < 8; ++c) {
        if (!isWhole) {
            int mark = markAt(texel + cornerOf(c));
            if (mark == 0 || (mark - 1 >> component & 1) != 0) return false;
        }
        corners[c] = texelFetch(codes, texel + cornerOf(c), 0)[component];
    }
    code = interpolate(corners, clamp(local - cell, 0.0, 1.0));
    return true;
}

// From half a voxel before the place to half a voxel behind it, on one side alone where the other isn't known.
vec3 slopeAt(vec3 local) {
    float middle;
    if (!codeNear(local, middle)) return vec3(0);
    vec3 slope;
    for (int a = 0; a < 3; ++a) {
        vec3 half_ = vec3(0);
        half_[a] = 0.5;
        float below, above;
        bool isBelow = codeNear(local - half_, below), isAbove = codeNear(local + half_, above);
        slope[a] = isBelow && isAbove ? above - below
                   : isAbove          ? 2.0 * (above - middle)
                   : isBelow          ? 2.0 * (middle - below)
                                      : 0.0;
    }
    return slope;
}
