// The operations by which every shader decides and samples, in one order: the same bits everywhere.

// The least distance of a place to the four faces, in voxels.
double depthAt(dvec4 nx, dvec4 ny, dvec4 nz, dvec4 offset, vec3 place) {
    precise dvec4 distances = nx * double(place.x) + ny * double(place.y) + nz * double(place.z) + offset;
    return min(min(distances.x, distances.y), min(distances.z, distances.w));
}
float depthAt(vec4 nx, vec4 ny, vec4 nz, vec4 offset, vec3 place) {
    precise vec4 distances = nx * place.x + ny * place.y + nz * place.z + offset;
    return min(min(distances.x, distances.y), min(distances.z, distances.w));
}

// Of two elements the one with the larger number owns a point.
float orderOf(float depth) {
    precise float order = 0.5 + depth * DEPTH_SCALE;
    return order;
}

// A channel's code at a place. What is denormal is zero, whether the device keeps it or not.
float codeAt(vec4 gradient, vec4 values, vec3 place) {
    const float kLeast = 1.17549435e-38;
    precise float rise = gradient.x * place.x + gradient.y * place.y + gradient.z * place.z + gradient.w;
    precise float sum = values.x + rise;
    float code = clamp(sum, values.y, values.z);
    return abs(code) < kLeast ? 0.0 : code;
}
