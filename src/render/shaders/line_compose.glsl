// Puts lines, and what rays meet behind them, behind what they have met before.
layout(binding = 0) uniform sampler2D lineColors;
layout(binding = 1) uniform sampler2D behindLines;

layout(location = 0) out vec4 color;

void main() {
    ivec2 texel = ivec2(gl_FragCoord.xy);
    vec4 line = texelFetch(lineColors, texel, 0);
    if (line.a == 0.0) discard;
    color = vec4(line.rgb * line.a, line.a) + (1.0 - line.a) * texelFetch(behindLines, texel, 0);
}
