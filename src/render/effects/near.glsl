// The code at a place that may lie beyond the brick that is drawn. False where a sample around isn't in the mesh or isn't finite.
bool codeNear(vec3 local, out float code) {
    ivec3 slotTexel = bricks[number].texel;
    bool isWhole = bricks[number].isWhole != 0;
    if (any(lessThan(local, vec3(0))) || any(greaterThan(local, vec3(CELLS)))) {
        int depth = bricks[number].depth;
        ivec3 index = bricks[number].index;
        vec3 place = (vec3(index & ((1 << depth) - 1)) + local / float(CELLS)) / float(1 << depth);
        vec3 root = floor(place);
        FoundBrick near = findBrick((index >> depth) + ivec3(root), place - root);
        if (!slotTexelOf(near, slotTexel)) return false;
        isWhole = false;
        local = near.inBrick * float(CELLS);
    }
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
