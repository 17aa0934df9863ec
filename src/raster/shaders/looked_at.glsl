// Which elements are looked at: all of the mesh, or those that the processor's index found.
layout(std430, binding = 3) readonly buffer Candidates {
    uint candidates[];
};
uniform bool areCandidates;

uint elementOf(uint item) {
    return areCandidates ? candidates[item] : item;
}
