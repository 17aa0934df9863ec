// The slices of one brick along the ray of one pixel.
uniform vec3 forward, right, up;  // right and up over half the picture
uniform vec4 pictureFromPixel;    // scale and offset
uniform vec4 clips[32];           // normal and offset, relative to the eye
uniform int clipCount;
uniform float slicesAVoxel, layersAWorldUnit;

layout(location = 0) out vec4 color;

const float kDark = 1e-4;

// Colour times opacity, and opacity, before what there is so far.
void add(vec4 shown, inout vec3 sum, inout float light) {
    sum += light * shown.rgb;
    light *= 1.0 - shown.a;
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
    float begin = 0.0, end = 1e38;
    for (int a = 0; a < 3; ++a) {
        float low = bricks[number].low[a], high = bricks[number].high[a];
        if (direction[a] == 0.0) {
            // Along a face: the brick above it has it.
            if (!(low <= origin[a] && origin[a] < high)) discard;
            continue;
        }
        float toLow = (low - origin[a]) / direction[a], toHigh = (high - origin[a]) / direction[a];
        begin = max(begin, min(toLow, toHigh));
        end = min(end, max(toLow, toHigh));
    }
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
#ifdef FACE
    add(faceByEffects(from + begin * step), sum, light);
#endif
#ifdef SHEET
    float codeLast = 0.0, sampledTo = -1.0;
#endif
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
        vec3 middle = from + 0.5 * (first + last) * step;
        if (isInside && sampleBrick(middle, code)) {
            vec4 shown = shownAt(code);
            if (shown.a > 0.0) {
#ifdef SHADE
                shadeByEffects(shown, middle, direction);
#endif
                float passed = shown.a < 1.0 ? pow(1.0 - shown.a, (last - first) * layersAWorldUnit) : 0.0;
                sum += light * (1.0 - passed) * shown.rgb;
                light *= passed;
            }
#ifdef SHEET
            // What a slab begins with the one before it has ended with.
            vec3 there = from + first * step, beyond = from + last * step;
            float codeThere = codeLast, codeBeyond;
            if ((sampledTo == first || sampleBrick(there, codeThere)) && sampleBrick(beyond, codeBeyond)) {
                add(sheetByEffects(codeThere, codeBeyond, there, beyond, direction), sum, light);
                codeLast = codeBeyond;
                sampledTo = last;
            }
#endif
            if (light < kDark) break;
        }
        begin = next;
    }
#ifdef FACE
    add(faceByEffects(from + end * step), sum, light);
#endif
    color = vec4(sum, 1.0 - light);
}
