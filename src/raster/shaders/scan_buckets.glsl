// Where a box stands in the list of all, as src/raster/point_scan.cpp sorts them: those of easy elements and then
// those of thin ones, small boxes by tile and size and larger ones by the number of parts and tile.
uint bucketOf(Box box) {
    uvec3 low = unpack(box.low), size = unpack(box.last) - low + 1u, at = low >> TILE_SHIFT;
    uint tile = (at.z * TILES_AN_EDGE + at.y) * TILES_AN_EDGE + at.x, points = size.x * size.y * size.z;
    uint ofGrade = box.rank >> (kKindShift + 1u) == 0u ? 0u : BUCKETS;
    if (points <= PART_POINTS) return ofGrade + tile * SMALL_SIZES + uint(findMSB(points));
    uvec3 parts = (size + partSize(size) - 1u) / partSize(size);
    return ofGrade + SMALL_BUCKETS + uint(findMSB(parts.x * parts.y * parts.z - 1u)) * TILES + tile;
}
