// Light on a surface across the slope, as Blinn and Phong have it. Weights: ambient, diffuse, specular and
// shininess. Where codes rise by `even` a world unit, the direction is half believed.
vec3 litBy(vec3 light, vec4 weights, float even, vec3 color, vec3 slope, vec3 direction) {
    float steep = length(slope);
    if (!(steep > 0.0)) return color;
    vec3 normal = slope / steep;
    if (dot(normal, direction) > 0.0) normal = -normal;
    if (light == vec3(0)) light = -direction;
    float diffuse = max(dot(normal, light), 0.0);
    float specular = pow(max(dot(normal, normalize(light - direction)), 0.0), weights.w);
    vec3 lit = color * (weights.x + weights.y * diffuse) + weights.z * specular;
    float belief = steep / (steep + even * bricks[number].spacing);
    return clamp(mix(color, lit, belief), 0.0, 1.0);
}
