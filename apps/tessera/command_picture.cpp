#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <utility>

#include "commands.h"
#include "files/atomic_file.h"
#include "import_mesh.h"
#include "mesh/field_range.h"
#include "output_paths.h"
#include "pictures/image.h"
#include "pictures/sample_slice.h"
#include "report_text.h"
#include "tessera/error.h"
#include "tessera/registry.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_read.h"

namespace tessera {

namespace {

constexpr double kMargin = 0.02;  // around the covered points, as a share of their box

/// Box of the covered lattice points.
Box3d coveredBounds(const VdbFile& file) {
    Box3d bounds;
    const int n = file.store.tilesPerEdge();
    for (std::size_t leaf = 0; leaf < file.tree.leafCount(); ++leaf) {
        const BrickKey& key = file.tree.leaves()[leaf];
        const Lattice lattice = file.tree.lattice(key.level);
        const Vec3i first = file.tree.ownedPoints(key).min;
        for (int t = 0; t < file.store.tileCount(); ++t) {
            const Tile* tile = file.store.tile(leaf, t);
            if (!tile) continue;
            const Vec3i corner = first + kTileSize * Vec3i(t / (n * n), t / n % n, t % n);
            for (int offset = 0; offset < kTilePoints; ++offset)
                if (tile->covered(offset))
                    bounds.include(lattice.worldFromIndex(
                        Vec3d(corner + Vec3i(offset / 64, offset / 8 % 8, offset % 8))));
        }
    }
    return bounds;
}

const OutputField& chooseField(const VdbFile& file, const std::string& name) {
    if (file.fields.empty())
        throw InputError("the file holds no field, only which voxels lie in the mesh: nothing to draw");
    std::string there;
    for (const OutputField& field : file.fields) {
        if (field.name == name || (name.empty() && &field == &file.fields.front())) return field;
        there += (there.empty() ? "" : ", ") + field.name;
    }
    throw InputError(fmt::format("no field named '{}'; there are: {}", name, there));
}

/// What a cell that is partly outside the mesh is filled from: the mesh itself, or, without it, fields
/// without values.
struct OutsideFields {
    TetMesh mesh;
    std::vector<int> fields;
};

OutsideFields readOutside(const PictureArguments& arguments, const VdbFile& file, Session& session) {
    OutsideFields outside;
    if (arguments.mesh.empty()) {
        for (const OutputField& field : file.fields)
            outside.mesh.fields.push_back({field.name, FieldLocation::point, field.components, {}});
        outside.fields.resize(file.fields.size());
        std::iota(outside.fields.begin(), outside.fields.end(), 0);
        return outside;
    }
    ReadOptions options;
    for (const OutputField& field : file.fields) options.fields.push_back(field.sourceName);
    const std::optional<RepairOptions> repair = decodeRepair(file.repair);
    ImportedMesh imported = importMesh(arguments.mesh, options, repair, session);
    showRepair(arguments.mesh, imported, repair, session);
    outside.mesh = std::move(imported.mesh);
    for (const OutputField& output : file.fields) {
        const auto& fields = outside.mesh.fields;
        const auto found = std::find_if(fields.begin(), fields.end(), [&](const Field& field) {
            return field.name == output.sourceName && field.components == output.components &&
                   (field.location == FieldLocation::point) == (output.location == "point");
        });
        if (found == fields.end())
            throw InputError(
                fmt::format("{} has no field '{}' as the .vdb file has", arguments.mesh, output.sourceName));
        outside.fields.push_back(int(found - fields.begin()));
    }
    return outside;
}

/// One component, or the length of a vector when none is asked for.
ScalarImage sampleField(const VdbFile& file, const OutputField& field, const PictureArguments& arguments,
                        const Reconstruction& reconstruction, const SliceOptions& slice,
                        const Execution& execution) {
    if (arguments.component && *arguments.component >= field.components)
        throw InputError(fmt::format("--component: {} has {} components, counted from 0, got {}", field.name,
                                     field.components, *arguments.component));
    if (arguments.component || field.components == 1)
        return sampleSlice(file.tree, reconstruction, field.firstChannel + arguments.component.value_or(0),
                           slice, execution);
    ScalarImage image = sampleSlice(file.tree, reconstruction, field.firstChannel, slice, execution);
    for (float& value : image.values) value *= value;
    for (int c = 1; c < field.components; ++c) {
        const ScalarImage more =
            sampleSlice(file.tree, reconstruction, field.firstChannel + c, slice, execution);
        for (std::size_t i = 0; i < image.values.size(); ++i)
            image.values[i] += more.values[i] * more.values[i];
    }
    for (float& value : image.values) value = std::sqrt(value);
    return image;
}

SliceOptions sliceOptions(const PictureArguments& arguments, const VdbFile& file) {
    SliceOptions slice;
    slice.axis = arguments.axis == "x" ? 0 : arguments.axis == "y" ? 1 : 2;
    slice.pixels = arguments.pixels;
    slice.outlines = arguments.bricks;
    if (file.bricks) slice.outlined = &*file.bricks;
    if (!arguments.bounds.empty()) {
        slice.boundsWorld = parseBounds(arguments.bounds);
    } else {
        const Box3d covered = coveredBounds(file);
        if (covered.empty()) throw InputError(fmt::format("{}: no voxel lies in the mesh", arguments.input));
        const Vec3d margin = kMargin * (covered.max - covered.min);
        slice.boundsWorld = {covered.min - margin, covered.max + margin};
    }
    const int a = slice.axis;
    slice.positionWorld = arguments.at.value_or((slice.boundsWorld.min[a] + slice.boundsWorld.max[a]) / 2);
    if (!std::isfinite(slice.positionWorld)) throw InputError("--at: expected a finite number");
    return slice;
}

ValueRange shownRange(const ScalarImage& image) {
    ValueRange range;
    for (std::size_t i = 0; i < image.values.size(); ++i)
        if (image.coverage[i] && std::isfinite(image.values[i])) {
            range.min = std::min(range.min, double(image.values[i]));
            range.max = std::max(range.max, double(image.values[i]));
        }
    return range;
}

}  // namespace

int runPicture(const PictureArguments& arguments) {
    checkOutputPaths({arguments.input, arguments.mesh},
                     {{"--output", arguments.output}, {"--json", arguments.common.jsonPath}});
    chooseFormat(arguments.output, {}, {"png"});
    if (arguments.mesh.empty())
        refuseReaderBounds(arguments.common.reader, "without --mesh there is none to be read");
    Session session(arguments.common, arguments.output);
    checkWritable(arguments.output);
    const VdbFile file = readVdb(arguments.input);
    const OutputField& field = chooseField(file, arguments.field);
    SliceOptions slice = sliceOptions(arguments, file);
    const OutsideFields outside = readOutside(arguments, file, session);
    if (!arguments.mesh.empty()) {
        // The mesh's own outline, by the cut plane through it.
        const SliceFrame frame = sliceFrame(file.tree, slice);
        slice.coverage = resampleBlock(findResampler("software"), outside.mesh, {}, frame.lattice,
                                       {{0, 0, 0}, {frame.width, frame.height, 1}}, session.execution)
                             .coverage;
    }
    const NearestOnDemand nearest(outside.mesh, session.execution.threads);
    const Reconstruction reconstruction(outside.mesh, outside.fields, file.tree, file.store, nearest);
    const ScalarImage image = sampleField(file, field, arguments, reconstruction, slice, session.execution);

    const ValueRange range = shownRange(image);
    if (range.empty())
        throw InputError(
            fmt::format("{}: the plane {} = {:.9g} meets no voxel with a finite value of {}: nothing to draw",
                        arguments.input, arguments.axis, slice.positionWorld, field.name));
    PictureOptions options;
    options.title = fmt::format("{}  {} = {:.4g}", field.name, arguments.axis, slice.positionWorld);
    if (!arguments.range.empty()) {
        const std::array<double, 2> ends = parseRange("--range", arguments.range);
        options.min = ends[0];
        options.max = ends[1];
    }
    writeSlicePng(arguments.output, image, options);
    session.print(fmt::format("{}: {} on the plane {} = {:.6g}, {} x {} pixels, values {:.6g} to {:.6g}\n",
                              arguments.output, field.name, arguments.axis, slice.positionWorld, image.width,
                              image.height, range.min, range.max));
    if (!arguments.common.jsonPath.empty())
        writeJson(arguments.common.jsonPath, Json{{"schema", 1},
                                                  {"program", "tessera"},
                                                  {"version", TESSERA_VERSION},
                                                  {"command", "picture"},
                                                  {"input", arguments.input},
                                                  {"output", arguments.output},
                                                  {"field", field.name},
                                                  {"axis", arguments.axis},
                                                  {"at", slice.positionWorld},
                                                  {"size", {image.width, image.height}},
                                                  {"value_range", {range.min, range.max}}});
    return 0;
}

}  // namespace tessera
