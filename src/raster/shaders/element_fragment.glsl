// Decides by the distances to the four faces whether the element covers this lattice point.
uniform int layerAxis;

#ifdef THIN
flat in uint record;
flat in float layerPlace;
#else
flat in vec4 nx, ny, nz, offset;
flat in vec4 shift;
flat in vec4 gradient[CHANNELS];
flat in vec4 values[CHANNELS];
#endif

vec3 across(vec2 place) {
    return layerAxis == 2 ? vec3(place, 0) : layerAxis == 1 ? vec3(place.x, 0, place.y) : vec3(0, place);
}

void main() {
#ifdef THIN
    Geometry geometry = geometries[record];
    vec3 alongLayers = layerAxis == 2   ? vec3(0, 0, layerPlace)
                       : layerAxis == 1 ? vec3(0, layerPlace, 0)
                                        : vec3(layerPlace, 0, 0);
    vec3 place = across(gl_FragCoord.xy - 0.5) + alongLayers - geometry.base.xyz;
    double least = depthAt(geometry.nx, geometry.ny, geometry.nz, geometry.offset, place);
    if (least < -double(geometry.base.w)) discard;
    float depth = float(least);
#else
    vec3 place = across(gl_FragCoord.xy) + shift.xyz;
    float depth = depthAt(nx, ny, nz, offset, place);
    if (depth < -shift.w) discard;
#endif
    float sampled[CHANNELS];
    for (int c = 0; c < CHANNELS; ++c) {
#ifdef THIN
        vec4 slope = channels[record * uint(CHANNELS) + uint(c)].gradient;
        vec4 value = channels[record * uint(CHANNELS) + uint(c)].values;
#else
        vec4 slope = gradient[c];
        vec4 value = values[c];
#endif
        sampled[c] = codeAt(slope, value, place);
    }
    writeSample(sampled, orderOf(depth));
}
