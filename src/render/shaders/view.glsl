uniform vec3 forward, right, up;  // right and up over half the picture
uniform bool isParallel;
