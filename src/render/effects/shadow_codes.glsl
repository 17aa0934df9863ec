// The codes at the points of a grid along rays of the light, of those bricks that stand in one atlas.
layout(local_size_x = 4, local_size_y = 4, local_size_z = 4) in;
layout(r32f, binding = 0) uniform writeonly image3D grid;
uniform vec3 gridOrigin, gridSteps[3];  // in edges of bricks of depth 0
uniform vec3 eyeFromOrigin;             // of these edges; world units
uniform float rootEdge;                 // world units

void main() {
    ivec3 point = ivec3(gl_GlobalInvocationID);
    if (any(greaterThanEqual(point, imageSize(grid)))) return;
    vec3 place = gridOrigin + float(point.x) * gridSteps[0] + float(point.y) * gridSteps[1] + float(point.z) * gridSteps[2];
    vec3 root = floor(place), within;
    FoundBrick brick = findBrick(ivec3(root), place - root);
    ivec3 texel;
    if (!slotTexelOf(brick, texel)) return;
    ivec3 cell = cellAt(texel, brick.inBrick * float(CELLS), within);
    if (coverInCell(cell, within) < 0.0 || isFlawed(cell)) return;
    if (isHiddenAt(place * rootEdge - eyeFromOrigin)) return;
    imageStore(grid, point, vec4(codeInCell(cell, within)));
}
