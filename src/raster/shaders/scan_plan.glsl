// Sizes of the dispatches that follow, when it is known how many contenders there are: through their list or,
// where that had no room for all, through everything once more.
layout(std430, binding = 5) writeonly buffer Dispatches {
    uint groups[];  // x, y, z: of contenders and of everything that may have to be gone through again
};
uniform uvec3 groupsAgain[MOST_AGAIN];
uniform uint againCount;

void main() {
    if (threadIndex() != 0u) return;
    bool fits = contenderCount <= contenderRoom;
    uint ofContenders = fits ? (contenderCount + GROUP_THREADS - 1u) / GROUP_THREADS : 0u;
    uint rows = (ofContenders + GROUPS_A_ROW - 1u) / GROUPS_A_ROW;
    groups[0] = rows == 0u ? 0u : (ofContenders + rows - 1u) / rows;
    groups[1] = max(rows, 1u);
    groups[2] = 1u;
    for (uint i = 0u; i < againCount; ++i)
        for (int a = 0; a < 3; ++a) groups[3u * i + 3u + uint(a)] = fits ? 0u : groupsAgain[i][a];
}
