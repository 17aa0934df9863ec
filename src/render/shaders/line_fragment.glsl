// A line's colour, how much of the pixel it covers, and how far along the ray it is.
uniform vec3 forward, right, up;  // right and up over half the picture
uniform vec4 pictureFromPixel;    // scale and offset
uniform bool isParallel;
uniform vec2 depthRange;  // nearest, and 1 over what all lines span
uniform float raySize;    // opening in radians, or with parallel rays width in world units

flat in vec2 from, to, depths;
flat in float width;
flat in vec3 lineColor;

layout(location = 0) out vec4 color;
layout(location = 1) out float rayLength;

void main() {
    vec2 along = to - from, beside = gl_FragCoord.xy - from;
    float square = dot(along, along);
    float share = square > 0.0 ? clamp(dot(beside, along) / square, 0.0, 1.0) : 0.0;
    float apart = length(beside - share * along);
    float covered = clamp(0.5 * max(width, 1.0) + 0.5 - apart, 0.0, 1.0) * min(width, 1.0);
    if (!(covered * 255.0 >= 1.0)) discard;  // the texture would have none of it
    float depth = mix(depths.x, depths.y, share);
    vec2 place = gl_FragCoord.xy * pictureFromPixel.xy + pictureFromPixel.zw;
    float longer = 1.0;  // along the ray than across the view
    if (!isParallel) {
        depth = 1.0 / depth;
        longer = length(forward + place.x * right + place.y * up);
    }
    color = vec4(lineColor, covered);
    rayLength = depth * longer;
    // Where lines meet, the one that covers more of the pixel counts: they have no notches there.
    float deeper = (1.0 - covered) * 2.0 * max(width, 1.0) * raySize * (isParallel ? 1.0 : depth);
    gl_FragDepth = clamp((depth + deeper - depthRange.x) * depthRange.y, 0.0, 1.0);
}
