// The edges of bricks, a colour for each depth.
uniform float bricksWidth;  // half of a line's, in radians, or world units with parallel rays
uniform float bricksOpacity;

vec4 bricksFace(vec3 local) {
    // Distances from the nearest edge: the second smallest of those from the six faces.
    vec3 apart = min(local, float(CELLS) - local);
    float smallest = min(apart.x, min(apart.y, apart.z)), largest = max(apart.x, max(apart.y, apart.z));
    float second = (apart.x + apart.y + apart.z - smallest - largest) * bricks[number].spacing;
    vec3 place = bricks[number].low + local * bricks[number].spacing;
    float width = bricksWidth * (isParallel ? 1.0 : length(place));
    float opacity = bricksOpacity * (1.0 - smoothstep(0.5 * width, 1.5 * width, second));
    const vec3 colors[6] = vec3[](vec3(0.13, 0.40, 0.67), vec3(0.20, 0.63, 0.17), vec3(0.89, 0.47, 0.0),
                                  vec3(0.80, 0.11, 0.11), vec3(0.42, 0.24, 0.60), vec3(0.25, 0.25, 0.25));
    return vec4(colors[bricks[number].depth % 6], 1.0) * opacity;
}
