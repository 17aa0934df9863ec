// The light that comes to the points of a grid, by the codes there, from the last layer to the first.
layout(local_size_x = 8, local_size_y = 8) in;
layout(r32f, binding = 0) uniform readonly image3D grid;
layout(r32f, binding = 1) uniform writeonly image3D light;
uniform float layersAStep;
uniform float noCode;  // where nothing is shown

void main() {
    ivec3 size = imageSize(grid);
    ivec2 column = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(column, size.xy))) return;
    float depth = 0.0, last = noCode;
    for (int layer = size.z - 1; layer >= 0; --layer) {
        float code = imageLoad(grid, ivec3(column, layer)).r;
        bool isThere = code < noCode, wasThere = last < noCode;
        // Where the volume begins or ends between two points half of the way is in it.
        if (isThere && wasThere) depth += depthBetween(last, code) * layersAStep;
        else if (isThere) depth += 0.5 * depthBetween(code, code) * layersAStep;
        else if (wasThere) depth += 0.5 * depthBetween(last, last) * layersAStep;
        last = code;
        imageStore(light, ivec3(column, layer), vec4(exp(-depth)));
    }
}
