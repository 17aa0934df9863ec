// Coverage by two lookups in an alpha texture with a transparent border, or by the fill rule alone.
#ifdef SILHOUETTE
in vec4 barycentrics;
flat in vec4 ofNodes[CHANNELS];

uniform sampler2D alphaTexture;

float alphaOf(vec2 pair) {
    // One texel of border on each side.
    float size = float(textureSize(alphaTexture, 0).x);
    return texture(alphaTexture, (pair * (size - 2.0) + 1.0) / size).r;
}
#else
in vec4 gouraud;
#endif

void main() {
    float sampled[CHANNELS];
#ifdef SILHOUETTE
    if (alphaOf(barycentrics.xy) * alphaOf(barycentrics.zw) < 0.5) discard;
    for (int c = 0; c < CHANNELS; ++c) sampled[c] = dot(barycentrics, ofNodes[c]);
#else
    for (int c = 0; c < CHANNELS; ++c) sampled[c] = gouraud[c];
#endif
    writeSample(sampled, 0.5);
}
