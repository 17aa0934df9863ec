// The example of the README, as a project of its own: reads a mesh, in a process that it may crash, resamples
// it and writes an OpenVDB file.
#include <cstdio>
#include <numeric>

#include "reader/isolated_reader.h"
#include "refine/brick_result.h"
#include "refine/refine.h"
#include "registry/registry.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_write.h"

int main(int argc, char** argv) {
    if (argc != 3) return 2;
    const tessera::IsolatedReader reader{TESSERA_PROGRAM, {"read-mesh"}, QUICK_READER};
    const tessera::MeshFile file = tessera::readMeshIsolated(reader, argv[1], {}, {}, {});
    std::vector<int> fields(file.mesh.fields.size());
    std::iota(fields.begin(), fields.end(), 0);

    tessera::BrickResult bricks =
        tessera::refineAndResample(file.mesh, fields, tessera::findResampler("software"), {}, {});
    std::printf("%s: at most %.3g of the range off\n", bricks.report.fields.at(0).name.c_str(),
                bricks.report.fields.at(0).relativeMax);

    std::vector<tessera::OutputField> outputs;
    int channel = 0;
    for (const tessera::Field& field : file.mesh.fields) {
        const bool onPoints = field.location == tessera::FieldLocation::point;
        outputs.push_back({field.name, field.name, onPoints ? "point" : "cell", field.components, channel});
        channel += field.components;
    }
    tessera::writeVdb(argv[2], outputs, bricks, {}, {});
}
