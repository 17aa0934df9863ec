uniform vec4 clips[32];  // normal and offset, relative to the eye
uniform int clipCount;
