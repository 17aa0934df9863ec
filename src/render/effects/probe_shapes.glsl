// Shapes that take a part of the volume away. A ray is in each shape from one distance to another; what is
// taken away is a combination of shapes, in postfix notation.
uniform vec4 probeShapes[32];  // two for each: a plane's normal and offset; a ball's middle and radius; a box
uniform int probeKinds[16];
uniform int probeCount;
uniform int probeTerms[64];  // 0 and more: a shape; -1: union, -2: intersection, -3: difference of the two before
uniform int probeTermCount;
uniform bool probesKeepInside;

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
