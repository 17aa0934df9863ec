// Light on the volume's samples.
uniform vec3 shadingLight;    // towards the light; 0: from the camera
uniform vec4 shadingWeights;
uniform float shadingEven;

void shadingShade(inout vec4 shown, vec3 local, vec3 direction) {
    shown.rgb = litBy(shadingLight, shadingWeights, shadingEven, shown.rgb, slopeAt(local), direction);
}
