// Where a fragment's codes go.
#if CHANNELS == 1
layout(location = 0) out float codes;
#else
layout(location = 0) out vec4 codes;
#endif
#ifdef LEVELS
layout(location = 1) out float coverage;
#endif

void writeSample(float sampled[CHANNELS], float depth) {
#ifdef LEVELS
    coverage = takeCoverage(sampled);
#endif
#if CHANNELS == 1
    codes = sampled[0];
#else
    codes = vec4(0);
    for (int c = 0; c < CHANNELS; ++c) codes[c] = sampled[c];
#endif
    gl_FragDepth = depth;
}
