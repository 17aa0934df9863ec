// The slices of one brick along the ray of one pixel.
struct Stop {
    vec4 shown;  // colour and opacity
    float code;
    float padding[3];
};
layout(std430, binding = 1) readonly buffer StopBlock { Stop stops[]; };
layout(binding = 0) uniform sampler3D codes;
layout(binding = 1) uniform sampler3D coverage;

uniform vec3 forward, right, up;  // right and up over half the picture
uniform bool isParallel;
uniform vec4 pictureFromPixel;  // scale and offset
uniform vec4 clips[32];         // normal and offset, relative to the eye
uniform int clipCount;
uniform int component;
uniform float slicesAVoxel, layersAWorldUnit;

flat in int number;
layout(location = 0) out vec4 color;

const float kDark = 1e-4;

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

void main() {
    vec2 place = gl_FragCoord.xy * pictureFromPixel.xy + pictureFromPixel.zw;
    vec3 across = place.x * right + place.y * up;
    vec3 origin = isParallel ? across : vec3(0);
    vec3 direction = isParallel ? forward : normalize(forward + across);

    // Where the ray is in the brick and within the clips.
    float spacing = bricks[number].spacing;
    vec3 from = (origin - bricks[number].low) / spacing;
    vec3 step = direction / spacing;
    step = mix(step, vec3(1e-30), equal(step, vec3(0)));
    vec3 a = -from / step, b = (float(CELLS) - from) / step;
    vec3 enter = min(a, b), leave = max(a, b);
    float begin = max(max(enter.x, max(enter.y, enter.z)), 0.0);
    float end = min(leave.x, min(leave.y, leave.z));
    for (int i = 0; i < clipCount; ++i) {
        float rise = dot(clips[i].xyz, direction), missing = clips[i].w - dot(clips[i].xyz, origin);
        if (rise > 0.0) begin = max(begin, missing / rise);
        if (rise < 0.0) end = min(end, missing / rise);
        if (rise == 0.0 && missing > 0.0) discard;
    }
    if (!(begin < end)) discard;

    float slabsALength = dot(direction, forward) * slicesAVoxel / spacing;
    float slab = floor(begin * slabsALength - bricks[number].firstSlab);
    vec3 sum = vec3(0);
    float light = 1.0, cover = coverAt(from + begin * step);
    for (int left = 4 * int(float(CELLS) * max(slicesAVoxel, 1.0)); begin < end && left > 0; --left) {
        slab += 1.0;
        float next = min((bricks[number].firstSlab + slab) / slabsALength, end);
        if (left == 1) next = end;
        if (!(next > begin)) continue;
        // The part in the mesh, coverage being taken as linear in between.
        float coverNext = coverAt(from + next * step);
        float crossing = mix(begin, next, clamp(cover / (cover - coverNext), 0.0, 1.0));
        float first = cover < 0.0 ? crossing : begin, last = coverNext < 0.0 ? crossing : next;
        bool isInside = max(cover, coverNext) >= 0.0 && last > first;
        cover = coverNext;
        float code;
        if (isInside && sampleBrick(from + 0.5 * (first + last) * step, code)) {
            vec4 shown = shownAt(code);
            if (shown.a > 0.0) {
                float passed = shown.a < 1.0 ? pow(1.0 - shown.a, (last - first) * layersAWorldUnit) : 0.0;
                sum += light * (1.0 - passed) * shown.rgb;
                light *= passed;
                if (light < kDark) break;
            }
        }
        begin = next;
    }
    color = vec4(sum, 1.0 - light);
}
