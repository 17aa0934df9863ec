// Codes as a target holds them. LEVELS: steps of a normalised format, which needs a target for coverage.
#ifdef LEVELS
// A quarter of a step keeps the code whether the device rounds or truncates.
float quantise(float code, float levels) {
    return (floor(code * levels + 0.5) + 0.25) / levels;
}

// Coverage is 1 and a bit for each channel without a finite value; those are marked with 2.
float takeCoverage(inout float sampled[CHANNELS]) {
    float covered = 1;
    float bit = 1;
    for (int c = 0; c < CHANNELS; ++c) {
        if (sampled[c] > 1.5) covered += bit;
        bit *= 2;
        sampled[c] = quantise(min(sampled[c], 1.0), float(LEVELS));
    }
    return (covered + 0.25) / 255.0;
}
#endif
