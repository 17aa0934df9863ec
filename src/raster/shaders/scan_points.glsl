// Notes the points that the processor decided, a thread for each.
uniform uint pointCount;

void main() {
    uint index = threadIndex();
    if (index >= pointCount) return;
    DecidedPoint point = decided[index];
    uint at = placeOf(uvec3(point.place & 0xffffu, point.place >> 16, point.layer));
    float order = orderOf(point.depth);
#if defined(ORDERS)
    noteOrder(at, order);
#elif defined(RANKS)
    noteRank(at, order, kDecided | index);
#else
    uint first = takeFirst(at, kDecided | index);
    if (first != 0u) contend(at, order, kDecided | index, first);
#endif
}
