// Where bricks that the index finds stand in the textures.
uniform ivec3 slotsAlong;  // of an atlas
uniform int atlas;         // that is bound

// A brick's first texel; false where it isn't in this atlas, or there is none.
bool slotTexelOf(FoundBrick brick, out ivec3 texel) {
    int slots = slotsAlong.x * slotsAlong.y * slotsAlong.z;
    if (!brick.isThere || int(brick.slot) / slots != atlas) return false;
    int slot = int(brick.slot) % slots;
    texel = ivec3(slot % slotsAlong.x, slot / slotsAlong.x % slotsAlong.y, slot / (slotsAlong.x * slotsAlong.y)) *
            (CELLS + 1);
    return true;
}
