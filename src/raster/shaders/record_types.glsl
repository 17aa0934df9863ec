// An element as src/raster/prepared_region.h records it, and its channels.
// THIN: geometry in double. CHANNELS: 1 to 4.
#ifdef THIN
#define Real double
#define Real4 dvec4
#else
#define Real float
#define Real4 vec4
#endif

struct Geometry {
    Real4 nx, ny, nz, offset;  // of the four faces: distance = n . (p - base) + offset, in voxels
    vec4 base;                 // relative to the region's first point, and the slack
};
struct Channel {
    vec4 gradient;  // and the value's start at the base
    vec4 values;    // value to add to, low, high
};
