// What a brick has at a place, and how that is shown.
struct Stop {
    vec4 shown;  // colour and opacity
    float code;
    float padding[3];
};
layout(std430, binding = 1) readonly buffer StopBlock { Stop stops[]; };
layout(binding = 0) uniform sampler3D codes;
layout(binding = 1) uniform sampler3D coverage;

uniform bool isParallel;
uniform int component;

flat in int number;

float interpolate(const float corners[8], vec3 t) {
    vec4 x = mix(vec4(corners[0], corners[2], corners[4], corners[6]),
                 vec4(corners[1], corners[3], corners[5], corners[7]), t.x);
    vec2 y = mix(x.xz, x.yw, t.y);
    return mix(y.x, y.y, t.z);
}

ivec3 cornerOf(int c) {
    return ivec3(c & 1, c >> 1 & 1, c >> 2);
}

// The first texel of the cell around a place counted in voxels, and where in the cell that is.
ivec3 cellAt(vec3 local, out vec3 within) {
    vec3 cell = clamp(floor(local), vec3(0), vec3(CELLS - 1));
    within = clamp(local - cell, 0.0, 1.0);
    return bricks[number].texel + ivec3(cell);
}

int markAt(ivec3 texel) {
    return int(texelFetch(coverage, texel, 0).r * 255.0 + 0.5);
}

// Above 0 in the mesh: coverage less a half.
float coverAt(vec3 local) {
    if (bricks[number].isWhole != 0) return 0.5;
    vec3 within;
    ivec3 texel = cellAt(local, within);
    float corners[8];
    for (int c = 0; c < 8; ++c) corners[c] = markAt(texel + cornerOf(c)) > 0 ? 0.5 : -0.5;
    return interpolate(corners, within);
}

// False where a sample around has no finite value.
bool sampleBrick(vec3 local, out float code) {
    vec3 within;
    ivec3 texel = cellAt(local, within);
    if (bricks[number].isWhole == 0)
        for (int c = 0; c < 8; ++c) {
            int mark = markAt(texel + cornerOf(c));
            if (mark > 0 && (mark - 1 >> component & 1) != 0) return false;
        }
    float corners[8];
    for (int c = 0; c < 8; ++c) corners[c] = texelFetch(codes, texel + cornerOf(c), 0)[component];
    code = interpolate(corners, within);
    return true;
}

// Colour and opacity: linear between stops, constant beyond them; at a step, what stands above it.
vec4 shownAt(float code) {
    int low = 0, high = stops.length();  // the first stop above the code
    while (low < high) {
        int middle = (low + high) / 2;
        if (stops[middle].code > code)
            high = middle;
        else
            low = middle + 1;
    }
    if (low == 0) return stops[0].shown;
    if (low == stops.length()) return stops[low - 1].shown;
    float below = stops[low - 1].code;
    return mix(stops[low - 1].shown, stops[low].shown, (code - below) / (stops[low].code - below));
}
