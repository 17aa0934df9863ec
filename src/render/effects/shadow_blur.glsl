// Softens light across its rays, over two cells, so that the grid's columns don't show.
layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;
layout(r32f, binding = 0) uniform writeonly image3D grid;
layout(r32f, binding = 1) uniform readonly image3D light;

void main() {
    ivec3 point = ivec3(gl_GlobalInvocationID), size = imageSize(grid);
    if (any(greaterThanEqual(point, size))) return;
    float sum = 0.0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            ivec3 near = clamp(point + ivec3(x, y, 0), ivec3(0), size - 1);
            sum += float((2 - abs(x)) * (2 - abs(y))) / 16.0 * imageLoad(light, near).r;
        }
    imageStore(grid, point, vec4(sum));
}
