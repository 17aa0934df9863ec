// Whose the points are that several elements cover, a thread a contender: the greatest order (STEP 1), who of
// those that came first has it no longer (2), and the least rank of those that have it (3).
layout(local_size_x = 64) in;

void main() {
    uint index = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x +
                 gl_LocalInvocationIndex;
    if (index >= contenderCount) return;
    Contender contender = contenders[index];
#if STEP == 1
    atomicMax(marks[contender.at].order, contender.order);
#elif STEP == 2
    if (contender.firstOrder < marks[contender.at].order) marks[contender.at].rank = 0u;
#else
    if (contender.order == marks[contender.at].order) atomicMax(marks[contender.at].rank, ~contender.rank);
#endif
}
