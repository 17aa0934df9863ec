// Sums of all items before each, in levels: an item of the next level is the sum of FAN items of this one. Up
// through the levels sums are made, and on the way down spread.
layout(std430, binding = 0) readonly buffer Items {
    uint items[];
};
layout(std430, binding = 1) buffer Sums {
    uint sums[];  // level after level; the last one's only item is the sum of all
};
uniform uint level, nextLevel, count;  // where two levels begin, and the items of the first
uniform bool isDown, isFirst, isLast, areBits;

void main() {
    uint first = threadIndex() * FAN, end = min(first + FAN, count);
    if (first >= count) return;
    uint sum = isDown && !isLast ? sums[nextLevel + threadIndex()] : 0u;
    for (uint i = first; i < end; ++i) {
        uint item = sums[level + i];
        if (isFirst && !isDown) {
            item = areBits ? uint(bitCount(items[i])) : items[i];
            sums[level + i] = item;
        }
        if (isDown) sums[level + i] = sum;
        sum += item;
    }
    if (!isDown) sums[nextLevel + threadIndex()] = sum;
}
