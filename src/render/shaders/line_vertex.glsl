// Lines as boxes in the picture, a ray wider on all sides than they are.
struct Line {
    vec2 from, to;  // rays from the picture's bottom left
    vec2 depths;    // across the view; with rays from an eye 1 over that
    float width;
    uint color;
};
layout(std430, binding = 0) readonly buffer LineBlock { Line lines[]; };
uniform vec4 tile;  // left, bottom, width, height in rays

flat out vec2 from, to, depths;
flat out float width;
flat out vec3 lineColor;

void main() {
    Line line = lines[gl_InstanceID];
    from = line.from - tile.xy;
    to = line.to - tile.xy;
    depths = line.depths;
    width = line.width;
    lineColor = unpackUnorm4x8(line.color).rgb;
    vec2 along = to - from;
    float size = length(along);
    along = size > 1e-3 ? along / size : vec2(1, 0);
    vec2 across = vec2(-along.y, along.x);
    const ivec2 corners[6] = ivec2[](ivec2(0, 0), ivec2(1, 0), ivec2(1, 1), ivec2(0, 0), ivec2(1, 1), ivec2(0, 1));
    vec2 corner = vec2(corners[gl_VertexID]);
    float besides = 0.5 * max(width, 1.0) + 1.0;
    vec2 at = mix(from - besides * along, to + besides * along, corner.x) + besides * (2.0 * corner.y - 1.0) * across;
    gl_Position = vec4(2.0 * at / tile.zw - 1.0, 0, 1);
}
