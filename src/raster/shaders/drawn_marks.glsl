// Marks the listed elements that are drawn, a thread for 32 of them.
layout(std430, binding = 0) readonly buffer Boxes {
    Box boxes[];
};
layout(std430, binding = 1) writeonly buffer Marks {
    uint marks[];
};
uniform uint listedCount;

void main() {
    uint word = threadIndex(), first = 32u * word, some = min(32u, listedCount - min(first, listedCount));
    if (some == 0u) return;
    uint found = 0u;
    for (uint b = 0u; b < some; ++b) {
        uvec2 within = layersOf(boxes[first + b]);
        found |= uint(within.x < within.y) << b;
    }
    marks[word] = found;
}
