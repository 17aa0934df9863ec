// Where a sample's codes go. LEVELS: steps of a normalised format, which needs a target for coverage.
#if CHANNELS == 1
layout(location = 0) out float codes;
#else
layout(location = 0) out vec4 codes;
#endif
#ifdef LEVELS
layout(location = 1) out float coverage;

// A quarter of a step keeps the code whether the device rounds or truncates.
float quantise(float code, float levels) {
    return (floor(code * levels + 0.5) + 0.25) / levels;
}
#endif

void writeSample(float sampled[CHANNELS], float depth) {
#ifdef LEVELS
    // Coverage is 1 and a bit for each channel without a finite value; those are marked with 2.
    float covered = 1;
    float bit = 1;
    for (int c = 0; c < CHANNELS; ++c) {
        if (sampled[c] > 1.5) covered += bit;
        bit *= 2;
        sampled[c] = quantise(min(sampled[c], 1.0), float(LEVELS));
    }
    coverage = (covered + 0.25) / 255.0;
#endif
#if CHANNELS == 1
    codes = sampled[0];
#else
    codes = vec4(0);
    for (int c = 0; c < CHANNELS; ++c) codes[c] = sampled[c];
#endif
    gl_FragDepth = depth;
}
