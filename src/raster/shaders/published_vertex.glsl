#ifdef LAYERED
#extension GL_ARB_shader_viewport_layer_array : require
#endif
// The published methods. SILHOUETTE: a corner of the substitute geometry is a node of the element, with the
// barycentric coordinates of its projection onto the slice. Otherwise a corner of a slice polygon with its values.
#ifdef SILHOUETTE
struct Element {
    vec4 node[4];  // place in pixels and layers
    vec4 rise;     // of the barycentric coordinates, a layer
};
layout(std430, binding = 0) readonly buffer Elements {
    Element elements[];
};
layout(std430, binding = 1) readonly buffer NodeCodes {
    vec4 nodeCodes[];  // of the four nodes, channel by channel
};
layout(location = 0) in uvec2 recordAndCorner;  // layer, corner: 16 bits each

out vec4 barycentrics;
flat out vec4 ofNodes[CHANNELS];
#else
layout(location = 0) in vec2 corner;
layout(location = 1) in uint layerOfCorner;
layout(location = 2) in vec4 codesOfCorner;

out vec4 gouraud;
#endif

uniform vec2 clipFromPixel;
uniform int onlyLayer;

void main() {
#ifdef SILHOUETTE
    Element element = elements[recordAndCorner.x];
    uint layer = recordAndCorner.y & 0xffffu;
    uint node = recordAndCorner.y >> 16;
    vec2 at = element.node[node].xy;
    barycentrics = (float(layer) - element.node[node].z) * element.rise;
    barycentrics[node] += 1.0;
    for (int c = 0; c < CHANNELS; ++c) ofNodes[c] = nodeCodes[recordAndCorner.x * uint(CHANNELS) + uint(c)];
#else
    uint layer = layerOfCorner;
    vec2 at = corner;
    gouraud = codesOfCorner;
#endif
    gl_Position = vec4(at * clipFromPixel - 1.0, 0, 1);
#ifdef LAYERED
    gl_Layer = int(layer);
#else
    if (int(layer) != onlyLayer) gl_Position = vec4(2, 2, 2, 1);
#endif
}
