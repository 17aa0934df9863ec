#version 450 core
#extension GL_ARB_shader_viewport_layer_array : enable
#extension GL_AMD_vertex_shader_layer : enable

// One triangle over the whole target for each instance, in the layer of its number.
flat out float layerValue;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1);
    gl_Position = vec4(corner, 0, 1);
    gl_Layer = gl_InstanceID;
    layerValue = BASE + float(gl_InstanceID);
}
