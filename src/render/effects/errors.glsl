// The volume in the colours of its bricks' errors.
uniform vec3 errorsColors[5];  // without an error, at half the bound, at it; beyond it; not known
uniform float errorsBound, errorsStrength;

void errorsShade(inout vec4 shown, vec3 local, vec3 direction) {
    float error = bricks[number].effectNumber;
    float share = 2.0 * error / errorsBound;
    vec3 color = share < 1.0 ? mix(errorsColors[0], errorsColors[1], share)
                             : mix(errorsColors[1], errorsColors[2], share - 1.0);
    if (error > errorsBound) color = errorsColors[3];
    if (error < 0.0) color = errorsColors[4];
    shown.rgb = mix(shown.rgb, color, errorsStrength);
}
