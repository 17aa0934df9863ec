// Points that the processor decided, as src/raster/hard_elements.h holds them.
struct DecidedPoint {
    uint place;  // s, t: 16 bits each
    uint layer;
    float depth;
    float codes[4];
};
layout(std430, binding = 6) readonly buffer DecidedPoints {
    DecidedPoint decided[];
};
const uint kDecided = 4u << kKindShift;
