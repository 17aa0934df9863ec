// Lists the marked elements, ascending, a thread for 32 of them.
layout(std430, binding = 0) readonly buffer Marks {
    uint marks[];
};
layout(std430, binding = 1) readonly buffer Sums {
    uint sums[];
};
layout(std430, binding = 2) writeonly buffer Listed {
    uint listed[];
};
uniform uint wordCount;

void main() {
    uint word = threadIndex();
    if (word >= wordCount) return;
    uint to = sums[word];
    for (uint left = marks[word]; left != 0u; left &= left - 1u)
        listed[to++] = elementOf(32u * word + uint(findLSB(left)));
}
