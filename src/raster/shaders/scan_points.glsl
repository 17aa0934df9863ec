// Notes the points that the processor decided, a thread for each.
layout(local_size_x = 64) in;

uniform uint pointCount;

void main() {
    uint index = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x +
                 gl_LocalInvocationIndex;
    if (index >= pointCount) return;
    DecidedPoint point = decided[index];
    uint at = markOf(uvec3(point.place & 0xffffu, point.place >> 16, point.layer));
    float order = orderOf(point.depth);
#if defined(ORDERS)
    noteOrder(at, order);
#elif defined(RANKS)
    noteRank(at, order, kDecided | index);
#else
    if (!takeFirst(at, order, kDecided | index)) contend(at, order, kDecided | index);
#endif
}
