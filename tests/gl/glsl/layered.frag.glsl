#version 450 core

flat in float layerValue;
layout(location = 0) out float value;

void main() {
    value = shared_value(layerValue, gl_FragCoord.xy);
}
