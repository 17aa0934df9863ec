// The elements of a region and their channels.
layout(std430, binding = 0) readonly buffer Geometries {
    Geometry geometries[];
};
layout(std430, binding = 1) readonly buffer Channels {
    Channel channels[];
};
