flat in float depth;
flat in vec4 given;

void main() {
    float sampled[CHANNELS];
    for (int c = 0; c < CHANNELS; ++c) sampled[c] = given[c];
    writeSample(sampled, orderOf(depth));
}
