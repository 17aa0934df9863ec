#include "job/draw_vdb.h"

#include <fmt/format.h>

#include <cmath>
#include <numeric>
#include <utility>

#include "files/atomic_file.h"
#include "job/field_selection.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/vdb_contents.h"
#include "job/wrap_text.h"
#include "pictures/image.h"
#include "pictures/sample_slice.h"
#include "tessera/error.h"
#include "tessera/registry.h"
#include "vdb/vdb_file.h"

namespace tessera {

namespace {

constexpr double kMargin = 0.02;  // around the covered points, as a share of their box

/// What a cell that is partly outside the mesh is filled from: the mesh itself, or, without it, fields
/// without values.
struct OutsideFields {
    TetMesh mesh;
    std::vector<int> fields;
};

OutsideFields readOutside(const DrawRequest& request, const VdbFile& file, Job& job) {
    OutsideFields outside;
    if (request.mesh.empty()) {
        for (const OutputField& field : file.fields)
            outside.mesh.fields.push_back({field.name, FieldLocation::point, field.components, {}});
        outside.fields.resize(file.fields.size());
        std::iota(outside.fields.begin(), outside.fields.end(), 0);
        return outside;
    }
    ReadOptions options;
    for (const OutputField& field : file.fields) options.fields.push_back(field.sourceName);
    ImportedMesh imported = importMesh(request.mesh, options, decodeRepair(file.repair), job);
    tellRepair(request.mesh, imported, job);
    outside.mesh = std::move(imported.mesh);
    for (const OutputField& output : file.fields) {
        outside.fields.push_back(findSource(outside.mesh, output));
        if (outside.fields.back() < 0)
            throw InputError(
                fmt::format("{} has no field '{}' as the .vdb file has", request.mesh, output.sourceName));
    }
    return outside;
}

/// One component, or the length of a vector when none is asked for.
ScalarImage sampleField(const VdbFile& file, const OutputField& field, const DrawRequest& request,
                        const Reconstruction& reconstruction, const SliceOptions& slice,
                        const Execution& execution) {
    if (request.component && *request.component >= field.components)
        throw InputError(fmt::format("--component: {} has {} components, counted from 0, got {}", field.name,
                                     field.components, *request.component));
    if (request.component || field.components == 1)
        return sampleSlice(file.tree, reconstruction, field.firstChannel + request.component.value_or(0),
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

SliceOptions sliceOptions(const DrawRequest& request, const VdbFile& file) {
    SliceOptions slice;
    slice.axis = request.axis;
    slice.pixels = request.pixels;
    slice.outlines = request.bricks;
    if (file.bricks) slice.outlined = &*file.bricks;
    if (request.boundsWorld) {
        slice.boundsWorld = *request.boundsWorld;
    } else {
        const Box3d covered = coveredBounds(file);
        if (covered.empty()) throw InputError(fmt::format("{}: no voxel lies in the mesh", request.input));
        const Vec3d margin = kMargin * (covered.max - covered.min);
        slice.boundsWorld = {covered.min - margin, covered.max + margin};
    }
    const int a = slice.axis;
    slice.positionWorld = request.at.value_or((slice.boundsWorld.min[a] + slice.boundsWorld.max[a]) / 2);
    if (!std::isfinite(slice.positionWorld)) throw InputError("--at: expected a finite number");
    return slice;
}

}  // namespace

DrawnSlice drawVdb(const DrawRequest& request, Job& job) {
    checkOutputPaths({request.input, request.mesh},
                     {{"--output", request.output}, {"--json", job.reportPath}});
    chooseFormat(request.output, {}, {"png"});
    checkWritable(request.output);
    const VdbFile file = openVdb(request.input, VdbContents::all, job);
    const OutputField& field = chooseField(file, request.field);
    SliceOptions slice = sliceOptions(request, file);
    const OutsideFields outside = readOutside(request, file, job);
    if (!request.mesh.empty()) {
        // The mesh's own outline, by the cut plane through it.
        const SliceFrame frame = sliceFrame(file.tree, slice);
        slice.coverage = resampleBlock(findResampler("software"), outside.mesh, {}, frame.lattice,
                                       {{0, 0, 0}, {frame.width, frame.height, 1}}, job.execution)
                             .coverage;
    }
    const NearestOnDemand nearest(outside.mesh, job.execution.threads);
    const Reconstruction reconstruction(outside.mesh, outside.fields, file.tree, file.store, nearest);
    const ScalarImage image = sampleField(file, field, request, reconstruction, slice, job.execution);

    const DrawnSlice drawn{field.name, slice.positionWorld, image.width, image.height,
                           shownRange(image.values, image.coverage)};
    const char axis = "xyz"[request.axis];
    if (drawn.range.empty())
        throw InputError(
            fmt::format("{}: the plane {} = {:.9g} meets no voxel with a finite value of {}: nothing to draw",
                        request.input, axis, drawn.positionWorld, field.name));
    PictureOptions options;
    options.title =
        fmt::format("{}  {} = {:.4g}", shortened(field.name, kTitleNameColumns), axis, drawn.positionWorld);
    if (request.range) {
        options.min = (*request.range)[0];
        options.max = (*request.range)[1];
    }
    writeSlicePng(request.output, image, options);
    job.say(fmt::format("{}: {} on the plane {} = {:.6g}, {} x {} pixels, values {:.6g} to {:.6g}\n",
                        request.output, field.name, axis, drawn.positionWorld, image.width, image.height,
                        drawn.range.min, drawn.range.max));
    return drawn;
}

Json drawnJson(const DrawRequest& request, const DrawnSlice& drawn) {
    Json json = documentHead("picture");
    json["input"] = request.input;
    json["output"] = request.output;
    json["field"] = drawn.field;
    json["axis"] = std::string(1, "xyz"[request.axis]);
    json["at"] = drawn.positionWorld;
    json["size"] = {drawn.width, drawn.height};
    json["value_range"] = rangeJson(drawn.range);
    return json;
}

}  // namespace tessera
