// Nodes in the index space of an axis-parallel lattice, as src/index_space/node_kernel.cpp does it: a thread a node of
// the mesh, or of an element that is looked at.
layout(std430, binding = 0) readonly buffer Nodes {
    double nodesWorld[];  // x, y, z
};
layout(std430, binding = 1) writeonly buffer Frame {
    double frame[];  // the whole voxels of x, y, z, and the rest
};
layout(std430, binding = 2) writeonly buffer Rough {
    vec4 rough[];  // rounded places; far ones are cut
};
layout(std430, binding = 4) readonly buffer Tets {
    uvec4 tets[];
};
uniform dvec3 originWorld, spacingWorld;
uniform uint nodeCount;

// t - whole h, rounded once: the product is split into two doubles, and t is near it.
dvec3 remainder(dvec3 t, dvec3 whole, dvec3 h) {
    const double kSplit = 134217729.0LF;  // 2^27 + 1
    precise dvec3 product = whole * h;
    precise dvec3 w = kSplit * whole, wHigh = w - (w - whole), wLow = whole - wHigh;
    precise dvec3 v = kSplit * h, hHigh = v - (v - h), hLow = h - hHigh;
    precise dvec3 rest = ((wHigh * hHigh - product) + wHigh * hLow + wLow * hHigh) + wLow * hLow;
    precise dvec3 result = (t - product) - rest;
    return result;
}

void main() {
    uint node = threadIndex();
    if (node >= nodeCount) return;
    // Several threads may write the same.
    if (areCandidates) node = tets[candidates[node >> 2]][node & 3u] & ~DECIDED_BIT;
    precise dvec3 place = dvec3(nodesWorld[3u * node], nodesWorld[3u * node + 1u], nodesWorld[3u * node + 2u]);
    precise dvec3 t = place - originWorld;
    precise dvec3 back = t - place;
    precise dvec3 tail = (place - (t - back)) - (originWorld + back);
    precise dvec3 quotient = t / spacingWorld;
    precise dvec3 whole = floor(quotient);
    precise dvec3 part = (remainder(t, whole, spacingWorld) + tail) / spacingWorld;
    // Beyond 2^53 voxels nothing is left for the rest, which then is rounding alone.
    part = mix(part, dvec3(0), greaterThanEqual(abs(whole), dvec3(9007199254740992.0LF)));
    const double kFarthest = 4294967296.0LF;
    rough[node] = vec4(vec3(clamp(quotient, dvec3(-kFarthest), dvec3(kFarthest))), 0.0);
    if (any(isnan(quotient)) || any(isinf(quotient))) rough[node].w = 1.0;  // nowhere
    for (int a = 0; a < 3; ++a) {
        frame[6u * node + uint(a)] = whole[a];
        frame[6u * node + 3u + uint(a)] = part[a];
    }
}
