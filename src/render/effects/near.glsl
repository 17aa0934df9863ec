// The brick at a place that may lie beyond the one that is drawn; the place is counted in its voxels then. False
// where none is known.
bool slotNear(inout vec3 local, out ivec3 slotTexel, out bool isWhole) {
    slotTexel = bricks[number].texel;
    isWhole = bricks[number].isWhole != 0;
    if (all(greaterThanEqual(local, vec3(0))) && all(lessThanEqual(local, vec3(CELLS)))) return true;
    int depth = bricks[number].depth;
    ivec3 index = bricks[number].index;
    vec3 place = (vec3(index & ((1 << depth) - 1)) + local / float(CELLS)) / float(1 << depth);
    vec3 root = floor(place);
    FoundBrick near = findBrick((index >> depth) + ivec3(root), place - root);
    isWhole = false;
    local = near.inBrick * float(CELLS);
    return slotTexelOf(near, slotTexel);
}

// The code there. False where a sample around isn't in the mesh or isn't finite.
bool codeNear(vec3 local, out float code) {
    ivec3 slotTexel;
    bool isWhole;
    if (!slotNear(local, slotTexel, isWhole)) return false;
    vec3 within;
    ivec3 cell = cellAt(slotTexel, local, within);
    if (!isWhole)
        for (int c = 0; c < 8; ++c) {
            int mark = markAt(cell + cornerOf(c));
            if (mark == 0 || (mark - 1 >> component & 1) != 0) return false;
        }
    code = codeInCell(cell, within);
    return true;
}
