// What the processor must know of the records, in one place.
layout(std430, binding = 0) readonly buffer ThinSums {
    uint thinSums[];
};
layout(std430, binding = 1) readonly buffer HardElements {
    uint hardCount;
};
layout(std430, binding = 2) readonly buffer BucketSums {
    uint bucketSums[];
};
layout(std430, binding = 3) writeonly buffer Counts {
    uint counts[];  // thin elements, hard ones, and where runs of boxes begin
};
uniform uint thinTotal;  // where the sum of all stands

void main() {
    uint i = threadIndex();
    if (i == 0u) {
        counts[0] = thinSums[thinTotal];
        counts[1] = hardCount;
    }
    if (i > 2u * (PART_SIZES + 1u)) return;
    uint size = i % (PART_SIZES + 1u);
    counts[2u + i] =
        bucketSums[i / (PART_SIZES + 1u) * BUCKETS + (size == 0u ? 0u : SMALL_BUCKETS + (size - 1u) * TILES)];
}
