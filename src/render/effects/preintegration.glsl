// The transfer function between the codes at a slab's ends, the code taken as linear along the ray. A layer of
// opacity a stops -ln(1 - a) of the light's logarithm. That has a closed integral where a is linear, so the
// opacity is exact whatever stops lie between the ends. Colours are met in their order.

// Where in a slab its light comes from: opacities at its ends, and its depth.
float shareSeen(float one, float other, float depth) {
    float even = one + other > 0.0 ? (one + 2.0 * other) / (3.0 * (one + other)) : 0.5;
    return even / (1.0 + depth / 6.0);
}

// The way through a slab from one place to the next, the function being linear in between.
void pass(vec4 one, vec4 other, float at, float next, float layers, inout vec3 sum, inout float light,
          inout float seenAt) {
    float depth = meanDepth(one.a, other.a) * (next - at) * layers;
    // In parts where the light becomes less on the way and the colour changes.
    int parts = one.rgb == other.rgb ? 1 : int(clamp(ceil(4.0 * depth), 1.0, 6.0));
    for (int part = 0; part < parts; ++part) {
        vec4 low = mix(one, other, float(part) / float(parts));
        vec4 high = mix(one, other, float(part + 1) / float(parts));
        float partDepth = parts == 1 ? depth : meanDepth(low.a, high.a) * (next - at) / float(parts) * layers;
        float stopped = light * (1.0 - exp(-partDepth));
        float inPart = shareSeen(low.a, high.a, partDepth);
        sum += stopped * mix(low.rgb, high.rgb, inPart);
        seenAt += stopped * mix(at, next, (float(part) + inPart) / float(parts));
        light -= stopped;
    }
}

vec4 preintegrationClassify(float codeBegin, float codeEnd, float layers, out float share) {
    float span = codeEnd - codeBegin, code = codeBegin, at = 0.0, light = 1.0, seenAt = 0.0;
    bool rises = span > 0.0;
    vec3 sum = vec3(0);
    int above = stopAbove(codeBegin);
    // From stop to stop.
    for (int left = stops.length() + 1; left > 0 && at < 1.0 && light > 1e-4; --left) {
        float stop = rises ? (above < stops.length() ? stops[above].code : 1e38)
                           : (above > 0 ? stops[above - 1].code : -1e38);
        bool isLast = span == 0.0 || (rises ? stop >= codeEnd : stop <= codeEnd);
        float codeNext = isLast ? codeEnd : stop;
        float next = isLast ? 1.0 : clamp((stop - codeBegin) / span, at, 1.0);
        if (next > at)
            pass(shownBetween(above, code), shownBetween(above, codeNext), at, next, layers, sum, light, seenAt);
        at = next;
        code = codeNext;
        above += rises ? 1 : -1;
    }
    float opacity = 1.0 - light;
    share = opacity > 0.0 ? seenAt / opacity : 0.5;
    return opacity > 0.0 ? vec4(sum / opacity, opacity) : vec4(0);
}
