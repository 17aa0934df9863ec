// Whether nothing of the volume is shown at a place relative to the eye.
bool isHiddenAt(vec3 place) {
    for (int i = 0; i < clipCount; ++i)
        if (dot(clips[i].xyz, place) < clips[i].w) return true;
#ifdef HIDE
    if (isHiddenByEffects(place, vec3(0, 0, 1), 0.0)) return true;
#endif
    return false;
}
