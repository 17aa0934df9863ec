// Of the present chunk of larger boxes and of the one before or after it, in turns.
struct PartCount {
    uint groups[3];  // of the dispatch that goes through the parts
    uint parts;
};
layout(std430, binding = 4) buffer PartCounts {
    PartCount partCounts[2];
};
void clearPartCount(uint which) {
    partCounts[which] = PartCount(uint[3](0u, 1u, 1u), 0u);
}
