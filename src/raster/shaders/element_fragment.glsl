// Decides by the distances to the four faces whether the element covers this lattice point. The operations
// and their order are the same for every axis, region and number of channels, and so are the bits.
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
    precise dvec4 distances = geometry.nx * double(place.x) + geometry.ny * double(place.y) +
                              geometry.nz * double(place.z) + geometry.offset;
    double least = min(min(distances.x, distances.y), min(distances.z, distances.w));
    if (least < -double(geometry.base.w)) discard;
    float depth = float(least);
#else
    vec3 place = across(gl_FragCoord.xy) + shift.xyz;
    precise vec4 distances = nx * place.x + ny * place.y + nz * place.z + offset;
    float depth = min(min(distances.x, distances.y), min(distances.z, distances.w));
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
        precise float rise = slope.x * place.x + slope.y * place.y + slope.z * place.z + slope.w;
        precise float sum = value.x + rise;
        sampled[c] = clamp(sum, value.y, value.z);
    }
    writeSample(sampled, 0.5 + depth * DEPTH_SCALE);
}
