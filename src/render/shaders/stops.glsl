// How what a brick has is shown.
struct Stop {
    vec4 shown;  // colour and opacity
    float code;
    float depth;  // of effects
    float padding[2];
};
layout(std430, binding = 1) readonly buffer StopBlock { Stop stops[]; };

// The first stop above a code; the number of stops when there is none.
int stopAbove(float code) {
    int low = 0, high = stops.length();
    while (low < high) {
        int middle = (low + high) / 2;
        if (stops[middle].code > code)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

// Of the part of the function that ends with stop `above`, at a code in it.
vec4 shownBetween(int above, float code) {
    if (above == 0) return stops[0].shown;
    if (above == stops.length()) return stops[above - 1].shown;
    float below = stops[above - 1].code;
    return mix(stops[above - 1].shown, stops[above].shown, (code - below) / (stops[above].code - below));
}

// Colour and opacity: linear between stops, constant beyond them; at a step, what stands above it.
vec4 shownAt(float code) {
    return shownBetween(stopAbove(code), code);
}
