// How much light from all around comes to a sample: along the 12 directions to the corners of an icosahedron,
// over the outer half of the way to a sphere, the codes being taken as linear there. What is nearer belongs to the
// sample's own surface, which mustn't darken itself.
uniform float occlusionRadius;  // world units
uniform float occlusionStrength;
uniform float occlusionLayers;  // that half of the radius has

// How much of a place is in the mesh, by the samples around, and the code of those that are.
float coverAround(vec3 local, out float code) {
    ivec3 slotTexel;
    bool isWhole;
    code = 0.0;
    if (isHiddenAt(bricks[number].low + local * bricks[number].spacing)) return 0.0;
    if (!slotNear(local, slotTexel, isWhole)) return 0.0;
    vec3 within;
    ivec3 cell = cellAt(slotTexel, local, within);
    float sum = 0.0, cover = 0.0;
    for (int c = 0; c < 8; ++c) {
        ivec3 texel = cell + cornerOf(c);
        int mark = isWhole ? 1 : markAt(texel);
        if (mark == 0 || (mark - 1 >> component & 1) != 0) continue;
        vec3 sides = mix(1.0 - within, within, vec3(cornerOf(c)));
        float weight = sides.x * sides.y * sides.z;
        sum += weight * texelFetch(codes, texel, 0)[component];
        cover += weight;
    }
    if (cover > 0.0) code = sum / cover;
    return cover;
}

// Half of the directions; the others are opposite. None lies nearly along a plane of two axes.
const vec3 kWays[6] = vec3[](vec3(-0.216934, 0.219289, 0.951237),
                             vec3(0.501343, -0.506785, 0.701302),
                             vec3(-0.207349, 0.957142, 0.202202),
                             vec3(-0.954848, 0.217670, 0.202202),
                             vec3(0.692626, 0.509404, 0.510663),
                             vec3(-0.516852, -0.687086, 0.510663));

void occlusionShade(inout vec4 shown, vec3 local, vec3 direction) {
    float spacing = bricks[number].spacing, passed = 0.0;
    for (int d = 0; d < 12; ++d) {
        vec3 way = d < 6 ? kWays[d] : -kWays[d - 6];
        vec3 reach = way * (occlusionRadius / spacing), near = local + 0.5 * reach, far = local + reach;
        float first, last, coverFirst = coverAround(near, first), coverLast = coverAround(far, last);
        if (!(coverFirst > 0.0)) first = last;
        if (!(coverLast > 0.0)) last = first;
        passed += 1.0 - 0.5 * (coverFirst + coverLast) * (1.0 - exp(-depthBetween(first, last) * occlusionLayers));
    }
    // A plane keeps half of all light away.
    shown.rgb *= 1.0 - occlusionStrength * max(1.0 - passed / 6.0, 0.0);
}
