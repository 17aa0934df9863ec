// The octree of a pool's bricks, BrickIndex in pool/brick_index.h. The binding is BRICK_INDEX_BINDING.
layout(std430, binding = BRICK_INDEX_BINDING) readonly buffer BrickIndexBlock {
    ivec3 gridMin;
    int lift;
    ivec3 gridSize;
    uint firstNode;
    uint entries[];
} brickIndex;

struct FoundBrick {
    bool isThere;
    uint slot;
    int depth;
    vec3 inBrick;  // in [0, 1)
};

// The brick at a place: in brick `root` of depth 0, at `rest` in [0, 1) there.
FoundBrick findBrick(ivec3 root, vec3 rest) {
    FoundBrick none = FoundBrick(false, 0u, 0, vec3(0));
    ivec3 cell = (root >> brickIndex.lift) - brickIndex.gridMin;
    if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, brickIndex.gridSize))) return none;
    uint entry = brickIndex.entries[(cell.z * brickIndex.gridSize.y + cell.y) * brickIndex.gridSize.x + cell.x];
    int depth = -brickIndex.lift;
    while ((entry & 3u) == 2u) {
        ivec3 upper;
        if (depth < 0) {
            upper = (root >> (-depth - 1)) & 1;
        } else {
            rest *= 2.0;
            upper = ivec3(rest);
            rest -= vec3(upper);
        }
        entry = brickIndex.entries[brickIndex.firstNode + 8u * (entry >> 2) +
                                   uint(upper.x | upper.y << 1 | upper.z << 2)];
        ++depth;
    }
    if (entry == 0u) return none;
    return FoundBrick(true, entry >> 2, depth, rest);
}
