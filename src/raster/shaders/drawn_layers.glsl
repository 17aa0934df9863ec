// The layers, of those that are drawn, which an element of the kind that is drawn reaches: first and end.
uniform uint kind, layerBegin, layerEnd;
const uint kNoSlot = ~0u;      // behind the last element that is drawn
uniform ivec3 axes;  // lattice axes of s, t and the layers

uvec2 layersOf(Box box) {
    if (box.rank >> kKindShift != kind) return uvec2(0);  // nor has one that is no box
    return uvec2(max(layerBegin, unpack(box.low)[axes.z]), min(layerEnd, unpack(box.last)[axes.z] + 1u));
}
