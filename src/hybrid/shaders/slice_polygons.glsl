// The polygon in which a slice cuts an element, as src/hybrid/slice_polygon_generator.cpp finds it; of a small one
// the pixels that may lie in it, by the distances to the faces.
#ifdef LARGE
// Four bits the count of corners, then the two nodes of each one's edge, two bits each, for each set of nodes on the
// slice's upper side.
const uint kCuts[16] = uint[16](0x00000u, 0x0c843u, 0x0d943u, 0x9dc84u, 0x0e983u, 0x9ec44u, 0x8ed44u, 0x0edc3u,
                                0x0edc3u, 0x8ed44u, 0x9ec44u, 0x0e983u, 0x9dc84u, 0x0d943u, 0x0c843u, 0x00000u);
vec3 node[4];  // s, t and layers, from the element's first voxel
vec3 first;
float extent, off;

// By the lowest two bits; no array is indexed by what isn't constant.
vec3 nodeAt(uint which) {
    return (which & 2u) == 0u ? ((which & 1u) == 0u ? node[0] : node[1]) : (which & 1u) == 0u ? node[2] : node[3];
}

vec3 turned(vec3 place) {
    return vec3(place[axes.x], place[axes.y], place[axes.z]);
}

void begin(Placed placed) {
    for (int k = 0; k < 4; ++k) node[k] = turned(vec3(placed.node[k]));
    first = turned(vec3(placed.first - dvec3(regionMin)));
    vec3 sizes = vec3(placed.high - placed.low);
    extent = max(max(sizes.x, sizes.y), sizes.z);
    // Accepted points lie in an element whose nodes are off by this: rounding in float, for each voxel of size, with
    // room for that of the cut itself, and the margin.
    off = PLACE_ROUNDING * (extent + 1.0) + float(shapeElement(placed).margin);
}

int cornersIn(uint layer, out vec2 corner[4], inout float growth, inout ivec4 rect) {
    // A pixel centre this close to a polygon's bounding rectangle may be covered by it; polygons that would have to
    // grow by more make way for rectangles.
    const float kMargin = 1.0 / 256.0, kMostError = 1.0 / 64.0;
    float height = float(layer) - first.z;
    uint set = 0u;
    for (int k = 0; k < 4; ++k) set |= uint(node[k].z >= height) << k;
    uint cut = kCuts[set];
    int count = int(cut & 15u);
    corner = vec2[4](vec2(0), vec2(0), vec2(0), vec2(0));
    // The whole rectangle is drawn where a plane only touches the element, within rounding, and where a corner would
    // lose too much.
    if (count == 0 || extent > LARGEST_EXTENT) return 0;
    float error = 0.0;
    vec2 low = vec2(1e30), high = vec2(-1e30);
    for (int c = 0; c < 4; ++c) {
        if (c >= count) break;
        vec3 a = nodeAt(cut >> (4 + 4 * c)), b = nodeAt(cut >> (6 + 4 * c)), along = b - a;
        float share = clamp((height - a.z) / along.z, 0.0, 1.0);
        corner[c] = a.xy + share * along.xy;
        float run = max(abs(along.x), abs(along.y));
        error = max(error, 2.0 * min(run, off * (1.0 + run / abs(along.z))));
        low = min(low, corner[c]);
        high = max(high, corner[c]);
    }
    float margin = kMargin + error;
    vec2 lowest = ceil(low - margin) + first.xy, highest = floor(high + margin) + first.xy;
    rect.xy = max(rect.xy, ivec2(lowest));
    rect.zw = min(rect.zw, ivec2(highest));
    for (int c = 0; c < 4; ++c) corner[c] += first.xy + 0.5;
    growth += 1.5 * error;
    return error < kMostError ? count : 0;
}
#else
vec4 atCorner, alongS, alongT, alongLayers;

vec4 along(Geometry geometry, int axis) {
    return vec4(axis == 0 ? geometry.nx : axis == 1 ? geometry.ny : geometry.nz);
}

void begin(Geometry geometry, ivec4 all) {
    alongS = along(geometry, axes.x);
    alongT = along(geometry, axes.y);
    alongLayers = along(geometry, axes.z);
    vec3 base = geometry.base.xyz;
    atCorner = alongS * (float(all.x) - base[axes.x]) + alongT * (float(all.y) - base[axes.y]) -
               alongLayers * base[axes.z] + vec4(geometry.offset) + geometry.base.w + kSurely;
}

void rectIn(uint layer, inout ivec4 rect) {
    ivec2 size = rect.zw - rect.xy;
    ivec4 kept = ivec4(size + 1, ivec2(-1));
    vec4 atLayer = atCorner + alongLayers * float(layer);
    for (int t = 0; t <= size.y; ++t) {
        vec2 row = rowWithin(atLayer + alongT * float(t), alongS, float(size.x));
        if (row.x > row.y) continue;
        kept = ivec4(min(kept.xy, ivec2(int(row.x), t)), max(kept.zw, ivec2(int(row.y), t)));
    }
    rect = ivec4(rect.xy + kept.xy, rect.xy + kept.zw);
}
#endif
