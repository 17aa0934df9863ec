// The slices of one brick along the ray of one pixel.
uniform vec4 pictureFromPixel;  // scale and offset
uniform float slicesAVoxel, layersAWorldUnit;

layout(location = 0) out vec4 color;
#ifdef LINES
layout(location = 1) out vec4 behind;  // what lies behind a line
layout(binding = 3) uniform sampler2D lineColors;
layout(binding = 4) uniform sampler2D lineDistances;
#endif

const float kDark = 1e-4;
const int kMostSurfaces = 64;  // of effects, along a ray

// Colour times opacity, and opacity, before what there is so far.
void add(vec4 shown, inout vec3 sum, inout float light) {
    sum += light * shown.rgb;
    light *= 1.0 - shown.a;
}

#ifdef LINES
// Where a ray comes to the line, what it has met becomes what is before the line.
void comeTo(float place, float line, inout vec4 before, inout bool isBehind, inout vec3 sum, inout float light) {
    if (isBehind || place < line) return;
    before = vec4(sum, 1.0 - light);
    isBehind = true;
    sum = vec3(0);
    light = 1.0;
}
#endif

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
#ifdef LINES
    float line = texelFetch(lineDistances, ivec2(gl_FragCoord.xy), 0).r;
    if (texelFetch(lineColors, ivec2(gl_FragCoord.xy), 0).a == 1.0) end = min(end, line);
    vec4 before = vec4(0);
    bool isBehind = false;
#endif
    if (!(begin < end)) discard;

    float slabsALength = dot(direction, forward) * slicesAVoxel / spacing;
    float slab = floor(begin * slabsALength - bricks[number].firstSlab);
    vec3 sum = vec3(0);
    float light = 1.0, cover = coverAt(from + begin * step);
    int left = 4 * int(float(CELLS) * max(slicesAVoxel, 1.0));
#ifdef LINES
    comeTo(begin, line, before, isBehind, sum, light);
#endif
#ifdef FACE
    add(faceByEffects(from + begin * step), sum, light);
#endif
#if defined(SHEET) || defined(CLASSIFY)
    float codeLast = 0.0, sampledTo = -1.0;
#endif
    float partEnd = end;
#ifdef SURFACE
    // The next one; the first may be where the brick begins.
    float surface = surfaceBehind(origin, direction, begin > 0.0 ? intBitsToFloat(floatBitsToInt(begin) - 1) : -1.0);
#endif
#ifdef SHEET
    // A slab that has a sheet ends a part: many rays that take slabs together seldom have one each.
    bool hasSheet = false;
    vec3 sheetBegin, sheetEnd;
    float sheetCodeBegin, sheetCodeEnd;
#endif
#if defined(SURFACE) || defined(LINES) || defined(SHEET)
    // Part by part, each from one surface or line to the next.
    for (int parts = kMostSurfaces + left; begin < end && parts > 0 && light >= kDark; --parts) {
    partEnd = end;
    left += 4;
#ifdef LINES
    comeTo(begin, line, before, isBehind, sum, light);
    if (!isBehind) partEnd = min(partEnd, line);
#endif
#ifdef SURFACE
    if (surface == begin) {
        if (cover >= 0.0) add(surfaceByEffects(from + begin * step, origin, direction, begin), sum, light);
        surface = surfaceBehind(origin, direction, begin);
    }
    partEnd = min(partEnd, surface);
#endif
#ifdef HIDE
    if (isHiddenByEffects(origin, direction, 0.5 * (begin + partEnd))) {
        begin = partEnd;
        slab = floor(begin * slabsALength - bricks[number].firstSlab);
        cover = coverAt(from + begin * step);
        continue;
    }
#endif
#endif
    for (; begin < partEnd && left > 0; --left) {
        slab += 1.0;
        float next = min((bricks[number].firstSlab + slab) / slabsALength, partEnd);
        if (left == 1) next = partEnd;
        if (!(next > begin)) continue;
        // The part in the mesh, coverage being taken as linear in between.
        float coverNext = coverAt(from + next * step);
        float crossing = mix(begin, next, clamp(cover / (cover - coverNext), 0.0, 1.0));
        float first = cover < 0.0 ? crossing : begin, last = coverNext < 0.0 ? crossing : next;
        bool isInside = max(cover, coverNext) >= 0.0 && last > first;
        cover = coverNext;
        begin = next;
        if (!isInside) continue;
#if defined(SHEET) || defined(CLASSIFY)
        // What a slab begins with the one before it has ended with.
        vec3 there = from + first * step, beyond = from + last * step;
        float codeThere = codeLast, codeBeyond;
        bool hasEnds = (sampledTo == first || sampleBrick(there, codeThere)) && sampleBrick(beyond, codeBeyond);
        if (hasEnds) {
            codeLast = codeBeyond;
            sampledTo = last;
        }
#endif
#ifdef CLASSIFY
        if (!hasEnds) continue;
        float share;  // where in the slab it is seen
        vec4 shown = classifyByEffects(codeThere, codeBeyond, (last - first) * layersAWorldUnit, share);
#ifdef SHADE
        if (shown.a > 0.0) shadeByEffects(shown, mix(there, beyond, share), direction);
#endif
        add(vec4(shown.rgb, 1.0) * shown.a, sum, light);
#else
        float code;
        vec3 middle = from + 0.5 * (first + last) * step;
        if (!sampleBrick(middle, code)) continue;
        vec4 shown = shownAt(code);
        // A function may be opaque at one value alone. No length of the ray has it, but floats meet it.
        // 1 / (2 e) of the part further on the light is what it is in the mean around such a value.
        if (shown.a == 1.0 && sampleBrick(from + mix(first, last, 0.684) * step, code)) shown = shownAt(code);
        if (shown.a > 0.0) {
#ifdef SHADE
            shadeByEffects(shown, middle, direction);
#endif
            float passed = shown.a < 1.0 ? pow(1.0 - shown.a, (last - first) * layersAWorldUnit) : 0.0;
            sum += light * (1.0 - passed) * shown.rgb;
            light *= passed;
        }
#endif
#ifdef SHEET
        hasSheet = hasEnds && haveSheet(codeThere, codeBeyond);
        if (hasSheet) {
            sheetBegin = there, sheetEnd = beyond;
            sheetCodeBegin = codeThere, sheetCodeEnd = codeBeyond;
            break;
        }
#endif
        if (light < kDark) break;
    }
#ifdef SHEET
    if (hasSheet) add(sheetByEffects(sheetCodeBegin, sheetCodeEnd, sheetBegin, sheetEnd, direction), sum, light);
    hasSheet = false;
#endif
#if defined(SURFACE) || defined(LINES) || defined(SHEET)
    slab -= 1.0;  // a part ends within it
    }
#endif
#ifdef LINES
    comeTo(end, line, before, isBehind, sum, light);
#endif
#ifdef FACE
    add(faceByEffects(from + end * step), sum, light);
#endif
#ifdef LINES
    color = isBehind ? before : vec4(sum, 1.0 - light);
    behind = isBehind ? vec4(sum, 1.0 - light) : vec4(0);
#else
    color = vec4(sum, 1.0 - light);
#endif
}
