// Counts what a resample asks of an OpenGL device, from the primitives themselves and without a device:
// device_cost mesh.vtu [--points 256]; and times the processor's part on one thread. Pixels are those of the
// sprites and the areas of the triangles; a device shades whole quads of 2 x 2 pixels, llvmpipe blocks of 4
// x 4.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <numeric>
#include <string>
#include <vector>

#include "arguments.h"
#include "bench_statistics.h"
#include "hybrid/slice_polygon_generator.h"
#include "index_space/node_frame.h"
#include "mesh_files/read_mesh.h"
#include "raster/prepared_region.h"
#include "slicing/silhouette_generator.h"

namespace {

using namespace tessera;

struct Counts {
    std::int64_t records = 0, recordBytes = 0;
    std::int64_t sprites = 0, triangles = 0, vertices = 0, primitiveBytes = 0;
    double pixels = 0, quadPixels = 0;
    double generateMs = 0;

    Counts& operator+=(const Counts& other) {
        records += other.records;
        recordBytes += other.recordBytes;
        sprites += other.sprites;
        triangles += other.triangles;
        vertices += other.vertices;
        primitiveBytes += other.primitiveBytes;
        pixels += other.pixels;
        quadPixels += other.quadPixels;
        return *this;
    }
};

Counts countList(const PrimitiveList& list) {
    Counts counts;
    counts.sprites = std::int64_t(list.sprites.size());
    counts.triangles = std::int64_t(list.corners.size()) / 2;
    counts.vertices = counts.sprites + std::int64_t(list.corners.size());
    counts.primitiveBytes =
        std::int64_t(list.sprites.size() * sizeof(Sprite) + list.corners.size() * sizeof(PolygonVertex));
    for (const Sprite& sprite : list.sprites) {
        counts.pixels += double(sprite.edge) * sprite.edge;
        const auto quads = [&](int low) { return (low + sprite.edge - 1) / 2 - low / 2 + 1; };
        counts.quadPixels += 4.0 * quads(sprite.s) * quads(sprite.t);
    }
    for (std::size_t i = 0; i < list.corners.size(); i += i % 4 == 0 ? 1 : 3) {
        const PolygonVertex& a = list.corners[i - i % 4];
        const PolygonVertex& b = list.corners[i + 1];
        const PolygonVertex& c = list.corners[i + 2];
        const double area =
            std::fabs(double(b.s - a.s) * double(c.t - a.t) - double(b.t - a.t) * double(c.s - a.s)) / 2;
        counts.pixels += area;
        const auto [lowS, highS] = std::minmax({a.s, b.s, c.s});
        const auto [lowT, highT] = std::minmax({a.t, b.t, c.t});
        // A quad is shaded when one of its centres is inside. Quads of whose centres the square is met, on
        // average over the triangle's places: no fewer.
        counts.quadPixels += area + double(highS - lowS) + double(highT - lowT) + 1;
    }
    return counts;
}

/// All slabs of a region of points^3 that spans the mesh.
Counts countGenerator(const SliceGenerator& generator, const RasterInputs& inputs,
                      const PreparedRegion& region) {
    constexpr int kLayersASlab = 8;
    const ActiveElements active = listActiveElements(region, inputs.axes, kLayersASlab);
    const int layers = region.points.size()[inputs.axes.l];
    Counts counts;
    counts.records = std::int64_t(region.elements.size());
    counts.recordBytes = std::int64_t(region.easy.geometry.size() * sizeof(EasyGeometry) +
                                      region.thin.geometry.size() * sizeof(ThinGeometry) +
                                      (region.easy.channels[0].size() + region.thin.channels[0].size()) *
                                          sizeof(ChannelRecord));
    for (std::size_t slab = 0; slab < active.slabCount(); ++slab) {
        SlabInput input;
        input.axes = inputs.axes;
        input.size = region.points.size();
        input.layerBegin = int(slab) * kLayersASlab;
        input.layerEnd = std::min(input.layerBegin + kLayersASlab, layers);
        input.elements = region.elements;
        input.active = active.of(slab);
        SliceBatch batch;
        const double before = tessera::bench::processorMs();
        generator.emit(input, batch);
        counts.generateMs += tessera::bench::processorMs() - before;
        counts += countList(batch.easy);
        counts += countList(batch.thin);
    }
    return counts;
}

void count(const std::string& path, int points) {
    const MeshFile file = readMesh(path, {}, {});
    const Box3d bounds = file.mesh.boundsWorld();
    const Vec3d size = bounds.size();
    const double spacing = std::max({size.x, size.y, size.z}) / (points - 1);
    const NodeFrame frame = frameNodes(file.mesh, Lattice::axisParallel(bounds.min, spacing), {});
    std::vector<ChannelCoding> channels;
    if (!file.mesh.fields.empty()) channels.emplace_back(file.mesh.fields[0], 0, SampleFormat::r32f);
    const RasterInputs inputs{file.mesh, frame, channels, SampleFormat::r32f,
                              SliceAxes::along(chooseLayerAxis(file.mesh, frame, {}))};
    std::vector<std::int32_t> all(std::size_t(file.mesh.elementCount()));
    std::iota(all.begin(), all.end(), 0);
    Execution execution;
    execution.threads = 1;
    const double before = tessera::bench::processorMs();
    const PreparedRegion region =
        prepareRegion(inputs, {{0, 0, 0}, {points, points, points}}, all, execution);
    const double prepareMs = tessera::bench::processorMs() - before;
    fmt::print("{} elements, {}^3 points, one field; records take {:.0f} ms of processor time\n",
               file.mesh.elementCount(), points, prepareMs);
    fmt::print("{:<8} {:>9} {:>12} {:>9} {:>9} {:>10} {:>15} {:>12} {:>14} {:>12}\n", "", "records",
               "record bytes", "sprites", "triangles", "vertices", "primitive bytes", "pixels",
               "quads' pixels", "processor ms");
    const auto print = [&](const char* name, const SliceGenerator& generator) {
        const Counts c = countGenerator(generator, inputs, region);
        fmt::print("{:<8} {:>9} {:>12} {:>9} {:>9} {:>10} {:>15} {:>12.0f} {:>14.0f} {:>12.0f}\n", name,
                   c.records, c.recordBytes, c.sprites, c.triangles, c.vertices, c.primitiveBytes, c.pixels,
                   c.quadPixels, c.generateMs);
    };
    print("slicing", SilhouetteGenerator());
    print("hybrid", SlicePolygonGenerator());
}

}  // namespace

int main(int wordCount, char** words) {
    std::string path;
    int points = 256;
    tessera::bench::Arguments arguments("Counts what a resample asks of an OpenGL device.");
    arguments.addNeeded("mesh", path, "a .vtu file, e.g. what tessera-tetrahedralize makes of graded:150K");
    // More would be several regions.
    arguments.add("--points", points, "lattice points along an axis", {2, 256});
    return arguments.run(wordCount, words, [&] {
        count(path, points);
        return 0;
    });
}
