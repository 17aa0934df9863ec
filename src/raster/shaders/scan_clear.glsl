// Forgets what is noted of all points.
layout(local_size_x = 64) in;

uniform uint pointCount;

void main() {
    uint at = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x +
              gl_LocalInvocationIndex;
    if (at < pointCount) owners[at] = orders[at] = 0u;
}
