// An element's silhouette along the slice axis, the same in every slice, as src/slicing/silhouette_generator.cpp
// finds it.
#ifdef LARGE
// Four bits the count of corners, then each one's node, for each set of front faces (bit j: that opposite node j).
const uint kSilhouettes[16] = uint[16](0x00000u, 0x03213u, 0x03203u, 0x31204u, 0x03103u, 0x32104u, 0x32014u, 0x02103u,
                                       0x02103u, 0x23104u, 0x23014u, 0x03103u, 0x13024u, 0x03203u, 0x03213u, 0x00000u);
vec2 silhouette[4];
int silhouetteCorners;

void begin(Placed placed) {
    vec2 node[4];
    for (int k = 0; k < 4; ++k) node[k] = vec2(placed.node[k][axes.x], placed.node[k][axes.y]);
    vec2 low = min(min(node[0], node[1]), min(node[2], node[3])), high = max(max(node[0], node[1]), max(node[2], node[3]));
    // Where a face stands on edge its sign may be wrong: such outlines have corners too sharp to be grown.
    uint front = 0u;
    for (int j = 0; j < 4; ++j) {
        vec2 a = node[(j + 1) & 3], p = node[(j + 2) & 3] - a, q = node[(j + 3) & 3] - a;
        float area = p.x * q.y - p.y * q.x;
        // Taken round by one node, faces turn the other way about.
        if ((j & 1) != 0 ? area < 0.0 : area > 0.0) front |= 1u << j;
    }
    uint all = kSilhouettes[front];
    silhouetteCorners = any(greaterThan(high - low, vec2(LARGEST_EXTENT))) ? 0 : int(all & 15u);
    vec3 first = vec3(placed.first - dvec3(regionMin));
    for (int k = 0; k < 4; ++k)
        silhouette[k] = node[all >> (4 + 4 * k) & 15u] + vec2(first[axes.x], first[axes.y]) + 0.5;
}

int cornersIn(uint layer, out vec2 corner[4], inout float growth, inout ivec4 rect) {
    corner = silhouette;
    return silhouetteCorners;
}
#else
void begin(Geometry geometry, ivec4 all) {}
void rectIn(uint layer, inout ivec4 rect) {}
#endif
