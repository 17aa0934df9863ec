#ifdef LAYERED
#extension GL_ARB_shader_viewport_layer_array : require
#endif
// A lattice point that was decided on the processor.
layout(location = 0) in uvec2 packedPlace;  // s, t: 16 bits each; layer
layout(location = 1) in float pointDepth;
layout(location = 2) in vec4 pointCodes;

uniform vec2 clipFromPixel;
uniform int onlyLayer;

flat out float depth;
flat out vec4 given;

void main() {
    depth = pointDepth;
    given = pointCodes;
    gl_PointSize = 1;
    vec2 at = vec2(packedPlace.x & 0xffffu, packedPlace.x >> 16) + 0.5;
    gl_Position = vec4(at * clipFromPixel - 1.0, 0, 1);
#ifdef LAYERED
    gl_Layer = int(packedPlace.y);
#else
    if (int(packedPlace.y) != onlyLayer) gl_Position = vec4(2, 2, 2, 1);
#endif
}
