// What the brick that is drawn has at a place, counted in its voxels.
flat in int number;

// Above 0 in the mesh.
float coverAt(vec3 local) {
    if (bricks[number].isWhole != 0) return 0.5;
    vec3 within;
    ivec3 cell = cellAt(bricks[number].texel, local, within);
    return coverInCell(cell, within);
}

// False where a sample around has no finite value.
bool sampleBrick(vec3 local, out float code) {
    vec3 within;
    ivec3 cell = cellAt(bricks[number].texel, local, within);
    if (bricks[number].isWhole == 0 && isFlawed(cell)) return false;
    code = codeInCell(cell, within);
    return true;
}
