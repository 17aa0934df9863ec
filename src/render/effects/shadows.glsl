// Light that comes through the volume from one direction: a texture of it, along rays of the light.
uniform sampler3D shadowLight;
uniform vec4 shadowRows[3];  // texture coordinates from edges of bricks of depth 0
uniform float shadowStrength;
uniform float shadowNearer;  // to the eye, in these edges

void shadowsShade(inout vec4 shown, vec3 local, vec3 direction) {
    vec3 place = (vec3(bricks[number].index) + local / float(CELLS)) / float(1 << bricks[number].depth);
    // What is seen has little before it, so a place nearer to the eye isn't in the shadow of its own surface.
    place -= shadowNearer * direction;
    vec3 at;
    for (int a = 0; a < 3; ++a) at[a] = dot(shadowRows[a].xyz, place) + shadowRows[a].w;
    shown.rgb *= 1.0 - shadowStrength * (1.0 - textureLod(shadowLight, at, 0.0).r);
}
