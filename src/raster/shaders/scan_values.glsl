// A thread for each point of the region writes what its owner says, and forgets the owner when no pass follows.
layout(std430, binding = 5) readonly buffer ThinChannels {
    Channel thinChannels[];
};
layout(binding = 0) writeonly uniform image3D codes;
#ifdef LEVELS
layout(binding = 1) writeonly uniform image3D coverage;
#endif
uniform float uncovered;  // the code of a point without an owner
uniform bool isLast;

void main() {
    uvec3 point = gl_GlobalInvocationID;
    if (point.x >= regionSize.x) return;
    uint at = placeOf(point);
    uint owner = owners[at];
    if (isLast) owners[at] = 0u;
    ivec3 texel = ivec3(point);
    if (owner == 0u) {
        imageStore(codes, texel, vec4(uncovered));
#ifdef LEVELS
        imageStore(coverage, texel, vec4(0));
#endif
        return;
    }
    uint kind = ~owner >> kKindShift, item = ~owner & kPlaceMask;
    float sampled[CHANNELS];
    if (kind < 2u) {
        vec3 place = vec3(point) - geometries[item].base.xyz;
        for (int c = 0; c < CHANNELS; ++c) {
            Channel channel = channels[item * uint(CHANNELS) + uint(c)];
            sampled[c] = codeAt(channel.gradient, channel.values, place);
        }
    } else if (kind < 4u) {
        vec3 place = vec3(point) - thinGeometries[item].base.xyz;
        for (int c = 0; c < CHANNELS; ++c) {
            Channel channel = thinChannels[item * uint(CHANNELS) + uint(c)];
            sampled[c] = codeAt(channel.gradient, channel.values, place);
        }
    } else {
        for (int c = 0; c < CHANNELS; ++c) sampled[c] = decided[item].codes[c];
    }
#ifdef LEVELS
    imageStore(coverage, texel, vec4(takeCoverage(sampled)));
#endif
    vec4 all = vec4(0);
    for (int c = 0; c < CHANNELS; ++c) all[c] = sampled[c];
    imageStore(codes, texel, all);
}
