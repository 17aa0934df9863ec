// Surfaces of single values, lit; ascending by code.
uniform vec4 isosurfaces[16];  // colour and opacity
uniform float isosurfaceCodes[16];
uniform int isosurfaceCount;
uniform vec3 isosurfaceLight;  // towards the light; 0: from the camera

bool isosurfacesCross(float codeBegin, float codeEnd) {
    for (int i = 0; i < isosurfaceCount; ++i)
        if ((codeBegin < isosurfaceCodes[i]) != (codeEnd < isosurfaceCodes[i])) return true;
    return false;
}

vec4 isosurfacesSheet(float codeBegin, float codeEnd, vec3 begin, vec3 end, vec3 direction) {
    vec4 sum = vec4(0);
    // In the order in which the ray meets them.
    for (int i = 0; i < isosurfaceCount; ++i) {
        int n = codeEnd > codeBegin ? i : isosurfaceCount - 1 - i;
        float code = isosurfaceCodes[n];
        if ((codeBegin < code) == (codeEnd < code)) continue;
        vec3 place = mix(begin, end, (code - codeBegin) / (codeEnd - codeBegin));
        vec3 color = litBy(isosurfaceLight, vec4(0.3, 0.65, 0.25, 40.0), 0.0, isosurfaces[n].rgb,
                           slopeAt(place), direction);
        sum += (1.0 - sum.a) * vec4(color, 1.0) * isosurfaces[n].a;
    }
    return sum;
}
