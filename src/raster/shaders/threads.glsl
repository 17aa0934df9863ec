// A dispatch has as many rows of workgroups as its threads need.
layout(local_size_x = GROUP_THREADS) in;

uint threadIndex() {
    return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x +
           gl_LocalInvocationIndex;
}
