// Planes with the field's colours, and lines on them where it has certain values.
uniform vec4 cutPlanes[16];  // normal and offset, relative to the eye
uniform float cutOpacities[16];
uniform int cutCount;
uniform float contourCodes[64];
uniform int contourCount;
uniform vec3 contourColor;
uniform float contourWidth;  // half of it, pixels
uniform float cutPixelSize;  // radians, or world units with parallel rays

float cutDistance(int plane, vec3 origin, vec3 direction) {
    float rise = dot(cutPlanes[plane].xyz, direction);
    precise float at = (cutPlanes[plane].w - dot(cutPlanes[plane].xyz, origin)) / rise;
    return rise == 0.0 ? 1e38 : at;
}

float cutsDistance(vec3 origin, vec3 direction, float after) {
    float next = 1e38;
    for (int i = 0; i < cutCount; ++i) {
        float at = cutDistance(i, origin, direction);
        if (at > after) next = min(next, at);
    }
    return next;
}

// Of the code at a place, by a step in voxels; a step.
float changeAlong(vec3 local, float code, vec3 step) {
    // No further than two voxels, however flat the view on the plane.
    float share = min(1.0, 2.0 / max(max(abs(step.x), abs(step.y)), max(abs(step.z), 1e-30)));
    float below, above;
    bool isBelow = codeNear(local - share * step, below), isAbove = codeNear(local + share * step, above);
    float change = isBelow && isAbove ? 0.5 * (above - below)
                   : isAbove          ? above - code
                   : isBelow          ? code - below
                                      : 0.0;
    return change / share;
}

// How much of a pixel a line covers.
float contourAt(vec3 local, float code, vec3 normal, vec3 direction, float at) {
    float apart = 1e38, second = 1e38;  // from the two nearest lines
    for (int i = 0; i < contourCount; ++i) {
        float one = abs(code - contourCodes[i]);
        second = min(second, max(apart, one));
        apart = min(apart, one);
    }
    // How the code changes on the plane from this pixel to the next ones.
    float size = cutPixelSize / bricks[number].spacing * (isParallel ? 1.0 : at * dot(direction, forward));
    vec3 aside = size * normalize(right), higher = size * normalize(up);
    float rise = dot(normal, direction);
    vec2 change = vec2(changeAlong(local, code, aside - direction * dot(normal, aside) / rise),
                       changeAlong(local, code, higher - direction * dot(normal, higher) / rise));
    float steep = length(change);
    if (!(steep > 0.0)) return 0.0;
    // Lines that are closer together than twice their width fade, as they would make the plane black.
    float fade = min(1.0, (apart + second) / (4.0 * contourWidth * steep));
    return fade * (1.0 - smoothstep(contourWidth - 0.5, contourWidth + 0.5, apart / steep));
}

vec4 cutsSurface(vec3 local, vec3 origin, vec3 direction, float at) {
    vec4 sum = vec4(0);
    float code;
#ifdef HIDE
    if (isHiddenByEffects(origin, direction, at)) return sum;
#endif
    if (!sampleBrick(local, code)) return sum;
    for (int i = 0; i < cutCount; ++i) {
        if (cutDistance(i, origin, direction) != at) continue;
        vec3 color = shownAt(code).rgb;
        if (contourCount > 0)
            color = mix(color, contourColor, contourAt(local, code, cutPlanes[i].xyz, direction, at));
        sum += (1.0 - sum.a) * vec4(color, 1.0) * cutOpacities[i];
    }
    return sum;
}
