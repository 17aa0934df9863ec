// How much of the light's logarithm the transfer function stops. Shared by effects. Stops have as `depth` the
// integral of -ln(1 - opacity) over the codes from the first stop on.

// The mean of -ln(1 - a) for a from one opacity to another; a lot where both are 1.
float meanDepth(float one, float other) {
    float u = 1.0 - one, v = 1.0 - other;
    float middle = 0.5 * (u + v), half_ = 0.5 * (u - v);
    if (middle <= 0.0) return 1e30;
    float r = half_ / middle, square = r * r;
    // The integral of -ln u is u - u ln u; close ends cancel there, so in a series.
    if (square < 0.09) return -log(middle) + square * (1.0 / 6.0 + square * (1.0 / 20.0 + square / 42.0));
    float atU = u > 0.0 ? u * log(u) : 0.0, atV = v > 0.0 ? v * log(v) : 0.0;
    return 1.0 - (atU - atV) / (u - v);
}

float depthTo(float code) {
    int above = stopAbove(code), below = max(above - 1, 0);
    float opacity = shownBetween(above, code).a;
    return stops[below].depth + (code - stops[below].code) * min(meanDepth(stops[below].shown.a, opacity), 100.0);
}

// The mean of -ln(1 - opacity) over the codes between two.
float depthBetween(float one, float other) {
    float span = other - one;
    if (abs(span) <= 1e-4 * (stops[stops.length() - 1].code - stops[0].code) || span == 0.0) {
        float opacity = shownAt(0.5 * (one + other)).a;
        return min(meanDepth(opacity, opacity), 100.0);
    }
    return max((depthTo(other) - depthTo(one)) / span, 0.0);
}
