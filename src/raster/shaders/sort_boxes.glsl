// Puts the boxes of the listed elements into their buckets, a thread an element.
layout(std430, binding = 0) readonly buffer Boxes {
    Box boxes[];
};
layout(std430, binding = 1) buffer BucketEnds {
    uint bucketEnds[];  // where the next box of each goes
};
layout(std430, binding = 2) writeonly buffer Sorted {
    Box sorted[];
};
uniform uint listedCount;

void main() {
    uint slot = threadIndex();
    if (slot >= listedCount) return;
    Box box = boxes[slot];
    if (box.rank != kNoBox) sorted[atomicAdd(bucketEnds[bucketOf(box)], 1u)] = box;
}
