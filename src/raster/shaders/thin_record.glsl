// Elements decided in double, beside those of record.glsl.
struct ThinGeometry {
    dvec4 nx, ny, nz, offset;
    vec4 base;
};
layout(std430, binding = 4) readonly buffer ThinGeometries {
    ThinGeometry thinGeometries[];
};
