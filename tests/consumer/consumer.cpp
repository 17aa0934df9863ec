// A project of its own that uses an installed Tessera: samples one tetrahedron whose field is x.
#include <cmath>
#include <cstdio>

#include "refine/brick_result.h"
#include "refine/refine.h"
#include "refine/refine_options.h"
#include "registry/registry.h"

int main() {
    tessera::TetMesh mesh;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.tets = {{0, 1, 2, 3}};
    mesh.fields = {{"x", tessera::FieldLocation::point, 1, {0, 1, 0, 0}}};

    tessera::RefineOptions options;
    options.criterion = tessera::Criterion::uniform;
    options.resolution = 33;
    const int fields[] = {0};
    const tessera::BrickResult result =
        tessera::refineAndResample(mesh, fields, tessera::findResampler("software"), options, {});

    const tessera::FieldError& error = result.report.fields.at(0);
    std::printf("%lld covered points, largest error %g\n",
                static_cast<long long>(result.report.coveredPoints), error.max);
    // Trilinear interpolation is exact for a linear field, up to float rounding.
    return result.report.coveredPoints > 0 && error.max < 1e-6 ? 0 : 1;
}
