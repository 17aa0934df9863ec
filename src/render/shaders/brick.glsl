// A brick as the processor places it. Places are relative to the eye, world units.
struct Brick {
    vec3 low;
    float spacing;
    vec3 high;      // bit by bit the low end of the next brick
    float besides;  // how far around the box fragments are asked for
    ivec3 texel;  // the slot's first
    int isWhole;
    ivec3 index;
    int depth;
    float firstSlab;  // counted from the eye, the brick's nearest
    float effectNumber;  // of the brick, where an effect asks for one; below 0: it isn't known
    float padding[2];
};
layout(std430, binding = 0) readonly buffer BrickBlock { Brick bricks[]; };
