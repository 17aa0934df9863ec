// The samples in slots: those of a cell are the eight texels from its first one on.
layout(binding = 0) uniform sampler3D codes;
layout(binding = 1) uniform sampler3D coverage;

uniform int component;

float interpolate(const float corners[8], vec3 t) {
    vec4 x = mix(vec4(corners[0], corners[2], corners[4], corners[6]),
                 vec4(corners[1], corners[3], corners[5], corners[7]), t.x);
    vec2 y = mix(x.xz, x.yw, t.y);
    return mix(y.x, y.y, t.z);
}

ivec3 cornerOf(int c) {
    return ivec3(c & 1, c >> 1 & 1, c >> 2);
}

// The cell around a place counted in voxels of a slot, and where in the cell that is.
ivec3 cellAt(ivec3 slotTexel, vec3 local, out vec3 within) {
    vec3 cell = clamp(floor(local), vec3(0), vec3(CELLS - 1));
    within = clamp(local - cell, 0.0, 1.0);
    return slotTexel + ivec3(cell);
}

int markAt(ivec3 texel) {
    return int(texelFetch(coverage, texel, 0).r * 255.0 + 0.5);
}

// The distance from the mesh's surface in some unit, above 0 in the mesh.
float coverInCell(ivec3 cell, vec3 within) {
    float corners[8];
    for (int c = 0; c < 8; ++c) corners[c] = texelFetch(coverage, cell + cornerOf(c), 0).g - 128.0 / 255.0;
    return interpolate(corners, within);
}

// Whether a covered sample of the cell has no finite value.
bool isFlawed(ivec3 cell) {
    for (int c = 0; c < 8; ++c) {
        int mark = markAt(cell + cornerOf(c));
        if (mark > 0 && (mark - 1 >> component & 1) != 0) return true;
    }
    return false;
}

float codeInCell(ivec3 cell, vec3 within) {
    float corners[8];
    for (int c = 0; c < 8; ++c) corners[c] = texelFetch(codes, cell + cornerOf(c), 0)[component];
    return interpolate(corners, within);
}
