// A brick as the processor places it. Places are relative to the eye, world units.
struct Brick {
    vec3 low;
    float spacing;
    ivec3 texel;  // the slot's first
    int isWhole;
    ivec3 index;
    int depth;
    float firstSlab;  // counted from the eye, the brick's nearest
    float padding[3];
};
layout(std430, binding = 0) readonly buffer BrickBlock { Brick bricks[]; };
