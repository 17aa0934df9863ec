// Records of channels, a thread an element: of easy ones where they stand in the list, or of thin ones; as
// src/raster/channel_coding.cpp makes them.
struct NodeCode {
    double code;
    float rounded;
    uint isInvalid;
};
layout(std430, binding = 2) readonly buffer Listed {
    uint listed[];
};
layout(std430, binding = 3) readonly buffer Boxes {
    Box boxes[];
};
layout(std430, binding = 4) readonly buffer NodeCodes {
    NodeCode nodeCodes[];  // node by node, channel by channel
};
layout(std430, binding = 5) readonly buffer CellCodes {
    float cellCodes[];
};
layout(std430, binding = 6) writeonly buffer Channels {
    Channel channels[];
};
layout(std430, binding = 7) readonly buffer ThinSlots {
    uint thinSlots[];
};
uniform uint elementCount;
uniform bool areThin;
uniform uint cellMask;  // a bit a channel: it is of cells
uniform float invalid;

float asFloat(double value) {
    return float(clamp(value, -LARGEST_FLOAT, LARGEST_FLOAT));
}

void main() {
    uint index = threadIndex();
    if (index >= elementCount) return;
    if (!areThin && boxes[index].rank >> (kKindShift + 1u) != 0u) return;  // none, or not easy
    uint slot = areThin ? thinSlots[index] : index;
    uint element = listed[slot];
    uvec4 tet = tets[element];
    Placed placed = placeNodes(tet);
    Shape shape = shapeElement(placed);
    dvec3 base = baseOf(placed);
    const uint nodeChannels = uint(CHANNELS - bitCount(cellMask)), cellChannels = uint(bitCount(cellMask));
    uint n = 0u, c = 0u;
    for (uint channel = 0u; channel < uint(CHANNELS); ++channel) {
        Channel made = Channel(vec4(0), vec4(0));
        if ((cellMask >> channel & 1u) != 0u) {
            made.values.xyz = vec3(cellCodes[element * cellChannels + c++]);
        } else {
            NodeCode codes[4];
            for (int k = 0; k < 4; ++k) codes[k] = nodeCodes[tet[k] * nodeChannels + n];
            ++n;
            if ((codes[0].isInvalid | codes[1].isInvalid | codes[2].isInvalid | codes[3].isInvalid) != 0u) {
                made.values.xyz = vec3(invalid);
            } else {
                precise dvec3 gradient = dvec3(0);
                precise double start = 0.0LF;
                for (int k = 1; k < 4; ++k) {
                    precise double slope = (codes[k].code - codes[0].code) / shape.height[k];
                    gradient += slope * shape.normal[k];
                    start += slope * offsetAt(shape, k, base);
                }
                made.gradient = vec4(asFloat(gradient.x), asFloat(gradient.y), asFloat(gradient.z), asFloat(start));
                made.values.x = float(codes[0].code);
                made.values.y = min(min(codes[0].rounded, codes[1].rounded), min(codes[2].rounded, codes[3].rounded));
                made.values.z = max(max(codes[0].rounded, codes[1].rounded), max(codes[2].rounded, codes[3].rounded));
            }
        }
        channels[(areThin ? index : slot) * uint(CHANNELS) + channel] = made;
    }
}
