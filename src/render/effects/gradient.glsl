// The slope of the codes, a voxel. Shared by the effects that need it.

// From half a voxel before the place to half a voxel behind it, on one side alone where the other isn't known.
vec3 slopeAt(vec3 local) {
    float middle;
    if (!codeNear(local, middle)) return vec3(0);
    vec3 slope;
    for (int a = 0; a < 3; ++a) {
        vec3 half_ = vec3(0);
        half_[a] = 0.5;
        float below, above;
        bool isBelow = codeNear(local - half_, below), isAbove = codeNear(local + half_, above);
        slope[a] = isBelow && isAbove ? above - below
                   : isAbove          ? 2.0 * (above - middle)
                   : isBelow          ? 2.0 * (middle - below)
                                      : 0.0;
    }
    return slope;
}
