// Shapes that take a part of the volume away, and the field's colours where they cut it. A ray is in each shape
// from one distance to another; what is taken away is a combination of shapes, in postfix notation.
uniform vec4 probeShapes[32];  // two for each: a plane's normal and offset; a ball's middle and radius; a box
uniform int probeKinds[16];
uniform int probeCount;
uniform int probeTerms[64];  // 0 and more: a shape; -1: union, -2: intersection, -3: difference of the two before
uniform int probeTermCount;
uniform bool probesKeepInside;
uniform float probeOpacity;
uniform vec3 probeLight;     // towards the light; 0: from the camera
uniform vec4 probeWeights;

vec2 probeSpan(int shape, vec3 origin, vec3 direction) {
    vec4 low = probeShapes[2 * shape], high = probeShapes[2 * shape + 1];
    precise vec2 span = vec2(-1e38, 1e38);
    if (probeKinds[shape] == 0) {
        float rise = dot(low.xyz, direction), missing = low.w - dot(low.xyz, origin);
        precise float at = missing / rise;
        if (rise > 0.0) span.x = at;
        if (rise < 0.0) span.y = at;
        if (rise == 0.0 && missing > 0.0) span = vec2(1e38, -1e38);
    } else if (probeKinds[shape] == 1) {
        vec3 toMiddle = low.xyz - origin;
        float middle = dot(toMiddle, direction);
        vec3 aside = toMiddle - middle * direction;
        float square = low.w * low.w - dot(aside, aside);
        precise float half_ = sqrt(max(square, 0.0));
        span = square > 0.0 ? vec2(middle - half_, middle + half_) : vec2(1e38, -1e38);
    } else {
        for (int a = 0; a < 3; ++a) {
            if (direction[a] == 0.0) {
                if (!(low[a] <= origin[a] && origin[a] < high[a])) span = vec2(1e38, -1e38);
                continue;
            }
            precise float toLow = (low[a] - origin[a]) / direction[a], toHigh = (high[a] - origin[a]) / direction[a];
            span.x = max(span.x, min(toLow, toHigh));
            span.y = min(span.y, max(toLow, toHigh));
        }
    }
    return span;
}

bool isTakenAway(uint shapes) {
    uint stack = 0u;
    for (int i = 0; i < probeTermCount; ++i) {
        int term = probeTerms[i];
        if (term >= 0) {
            stack = stack << 1 | (shapes >> term & 1u);
            continue;
        }
        uint last = stack & 1u;
        stack >>= 1;
        stack = term == -1 ? stack | last : term == -2 ? stack & (last | ~1u) : stack & ~last;
    }
    return (stack & 1u) != (probesKeepInside ? 1u : 0u);
}

bool probesHide(vec3 origin, vec3 direction, float at) {
    uint shapes = 0u;
    for (int i = 0; i < probeCount; ++i) {
        vec2 span = probeSpan(i, origin, direction);
        if (span.x <= at && at < span.y) shapes |= 1u << i;
    }
    return isTakenAway(shapes);
}

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
