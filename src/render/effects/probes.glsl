// Where shapes cut the volume: the field's colours.
uniform float probeOpacity;
uniform vec3 probeLight;     // towards the light; 0: from the camera
uniform vec4 probeWeights;

float probesDistance(vec3 origin, vec3 direction, float after) {
    float next = 1e38;
    for (int i = 0; i < probeCount; ++i) {
        vec2 span = probeSpan(i, origin, direction);
        if (!(span.x < span.y)) continue;
        if (span.x > after) next = min(next, span.x);
        if (span.y > after) next = min(next, span.y);
    }
    return next;
}

// Across a shape's surface, at a place relative to the eye.
vec3 probeNormal(int shape, vec3 place) {
    vec4 low = probeShapes[2 * shape], high = probeShapes[2 * shape + 1];
    if (probeKinds[shape] == 0) return low.xyz;
    if (probeKinds[shape] == 1) return place - low.xyz;
    // Of the box's face that is nearest.
    vec3 apart = min(abs(place - low.xyz), abs(place - high.xyz));
    float least = min(apart.x, min(apart.y, apart.z));
    return apart.x == least ? vec3(1, 0, 0) : apart.y == least ? vec3(0, 1, 0) : vec3(0, 0, 1);
}

vec4 probesSurface(vec3 local, vec3 origin, vec3 direction, float at) {
    uint before = 0u, behind = 0u;
    int shape = -1;
    for (int i = 0; i < probeCount; ++i) {
        vec2 span = probeSpan(i, origin, direction);
        if (span.x < at && at <= span.y) before |= 1u << i;
        if (span.x <= at && at < span.y) behind |= 1u << i;
        if (span.x < span.y && (span.x == at || span.y == at)) shape = i;
    }
    float code;
    if (shape < 0 || isTakenAway(before) == isTakenAway(behind) || !sampleBrick(local, code)) return vec4(0);
    vec3 color = shownAt(code).rgb;
    if (probeWeights.x < 1.0)
        color = litBy(probeLight, probeWeights, 0.0, color, probeNormal(shape, origin + at * direction), direction);
    return vec4(color, 1.0) * probeOpacity;
}
