// The boxes of bricks: the faces away from the eye are drawn, so that each pixel gets a fragment of a brick
// once, from inside of it too. The boxes are a little larger than the bricks: whether a ray meets a brick is
// for the fragment to say, as the rasterizer rounds otherwise and would leave cracks.
uniform vec4 tileFromPicture;  // scale and offset
uniform int firstBrick;

flat out int number;

void main() {
    const int corners[36] = int[](0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4,
                                  2, 6, 7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6);
    number = firstBrick + gl_InstanceID;
    int corner = corners[gl_VertexID];
    vec3 at = mix(bricks[number].low - bricks[number].besides, bricks[number].high + bricks[number].besides,
                  vec3(corner & 1, corner >> 1 & 1, corner >> 2));
    vec2 across = vec2(dot(at, right) / dot(right, right), dot(at, up) / dot(up, up));
    float w = isParallel ? 1.0 : dot(at, forward);
    gl_Position = vec4(across * tileFromPicture.xy + w * tileFromPicture.zw, 0.0, w);
}
