#ifdef LAYERED
#extension GL_ARB_shader_viewport_layer_array : require
#endif
// One element in one slice: a sprite (SPRITE) or a corner of a polygon. What a fragment needs is flat; only the
// provoking corner must have it.
#ifdef SPRITE
layout(location = 0) in uvec3 packedSprite;  // record; s, t; layer, edge: 16 bits each
#else
layout(location = 0) in vec2 corner;
layout(location = 1) in uvec2 recordAndLayer;
#endif

uniform vec2 clipFromPixel;
uniform int layerAxis;
uniform int onlyLayer;  // when the target has one layer

#ifdef THIN
flat out uint record;
flat out float layerPlace;
#else
flat out vec4 nx, ny, nz, offset;
flat out vec4 shift;  // place relative to the base = pixel + shift; and the slack
flat out vec4 gradient[CHANNELS];
flat out vec4 values[CHANNELS];
#endif

vec3 alongLayers(float place) {
    return layerAxis == 2 ? vec3(0, 0, place) : layerAxis == 1 ? vec3(0, place, 0) : vec3(place, 0, 0);
}
vec3 across(vec2 place) {
    return layerAxis == 2 ? vec3(place, 0) : layerAxis == 1 ? vec3(place.x, 0, place.y) : vec3(0, place);
}

void main() {
#ifdef SPRITE
    uint element = packedSprite.x;
    uint layer = packedSprite.z & 0xffffu;
    float edge = float(packedSprite.z >> 16);
    vec2 at = vec2(packedSprite.y & 0xffffu, packedSprite.y >> 16) + 0.5 * edge;
    gl_PointSize = edge;
#else
    uint element = recordAndLayer.x;
    uint layer = recordAndLayer.y;
    vec2 at = corner;
#endif
#ifdef THIN
    record = element;
    layerPlace = float(layer);
#else
    Geometry geometry = geometries[element];
    nx = geometry.nx;
    ny = geometry.ny;
    nz = geometry.nz;
    offset = geometry.offset;
    shift = vec4(alongLayers(float(layer)) - across(vec2(0.5)) - geometry.base.xyz, geometry.base.w);
    for (int c = 0; c < CHANNELS; ++c) {
        Channel channel = channels[element * uint(CHANNELS) + uint(c)];
        gradient[c] = channel.gradient;
        values[c] = channel.values;
    }
#endif
    gl_Position = vec4(at * clipFromPixel - 1.0, 0, 1);
#ifdef LAYERED
    gl_Layer = int(layer);
#else
    if (int(layer) != onlyLayer) gl_Position = vec4(2, 2, 2, 1);
#endif
}
