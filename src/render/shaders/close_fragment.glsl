// Closes pixels that let no light through: what is drawn later fails the depth test there.
layout(binding = 0) uniform sampler2D picture;

void main() {
    if (texelFetch(picture, ivec2(gl_FragCoord.xy), 0).a < 1.0 - 1e-4) discard;
}
