#include "tessera/write.h"

#include <cmath>
#include <filesystem>
#include <utility>

#include "library/brick_parts.h"
#include "refine/refine.h"
#include "tessera/error.h"
#include "vdb/output_formats.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_metadata.h"

namespace tessera {

namespace {

constexpr int kMostLayers = 64;
constexpr double kSmallestUnitScale = 1e-30, kLargestUnitScale = 1e30;

void checkRanges(const OutputOptions& options) {
    if (options.extend.value_or(0) < 0 || options.extend.value_or(0) > kMostLayers)
        throw InputError("extend must be from 0 to " + std::to_string(kMostLayers) + ", not " +
                         std::to_string(*options.extend));
    if (!(std::abs(options.voxelShift) <= 1)) throw InputError("voxelShift must be from -1 to 1");
    if (options.unitScale != 0 &&
        !(options.unitScale >= kSmallestUnitScale && options.unitScale <= kLargestUnitScale))
        throw InputError("unitScale must be 0, or from 1e-30 to 1e30");
}

const OutputFormat& formatOf(const std::string& path) {
    const std::string ending = std::filesystem::path(path).extension().string();
    std::string there;
    for (const OutputFormat& format : outputFormats()) {
        if (ending == std::string(".") + format.name) return format;
        there += (there.empty() ? "." : ", .") + std::string(format.name);
    }
    throw InputError(path + ": the name's ending says what kind of file to write; there are: " + there);
}

VdbLayout layoutOf(const OutputOptions& options, const OutputFormat& format) {
    if (options.layout == FileLayout::levels && !format.holdsLevels)
        throw InputError("a ." + std::string(format.name) + " file (" + format.title +
                         ") holds one grid a field, at one spacing; a .vdb file holds levels");
    if (options.layout == FileLayout::automatic)
        return format.holdsLevels ? VdbLayout::levels : VdbLayout::flat;
    return options.layout == FileLayout::levels ? VdbLayout::levels : VdbLayout::flat;
}

std::vector<OutputField> namedFields(const Bricks::Parts& parts, const OutputOptions& options) {
    std::vector<OutputField> outputs;
    std::size_t renamed = 0;
    for (std::size_t f = 0; f < parts.chosen.fields.size(); ++f) {
        const BrickField& field = parts.chosen.described[f];
        const auto found = options.names.find(field.name);
        renamed += found != options.names.end() ? 1 : 0;
        outputs.push_back({found != options.names.end() ? found->second : field.name,
                           parts.mesh->fields[std::size_t(parts.chosen.fields[f])].name,
                           field.location == FieldLocation::point ? "point" : "cell", field.components,
                           field.firstChannel});
    }
    if (renamed < options.names.size()) throw InputError("names has a field that the bricks don't hold");
    checkOutputFields(outputs);
    return outputs;
}

VdbWriteOptions writeOptions(const Bricks::Parts& parts, const OutputOptions& options, VdbLayout layout,
                             int layers) {
    VdbWriteOptions write;
    write.layout = layout;
    write.halfFloat = options.isHalf;
    write.background = options.background.value_or(0);
    write.hiddenValue = options.background;
    write.upAxis = options.axes == FileAxes::y   ? UpAxis::y
                   : options.axes == FileAxes::z ? UpAxis::z
                                                 : UpAxis::keep;
    write.unitScale = options.unitScale;
    write.voxelShift = options.voxelShift;
    write.boundsWorld = parts.refine.boundsWorld;
    write.layers = layers;
    write.maxVoxels = parts.refine.maxVoxels;
    write.algorithm = parts.options.algorithm;
    write.criterion = nameOf(parts.options.criterion);
    write.sourceFile = parts.sourceFile;
    write.time = parts.time;
    // Where every target gives the same bits, naming one would make the file depend on the processor.
    if (!parts.resampler->info().targetsAgree) write.target = parts.result.target;
    return write;
}

/// The bound is judged by what the file shows.
bool isFileWithinBound(const Bricks::Parts& parts, std::vector<std::string>& notes) {
    if (!parts.refine.criterion.has(Criterion::error)) return true;
    if (!parts.result.bounded || !isBoundedEverywhere(parts.refine)) return parts.result.bounded;
    std::string exceeded = exceededBound(*parts.mesh, parts.chosen.fields, parts.refine, parts.result.report);
    if (exceeded.empty() && parts.result.report.incomplete > 0)
        exceeded = std::to_string(parts.result.report.incomplete) +
                   " places beside voxels that it doesn't hold (extend = 1 adds them)";
    if (exceeded.empty()) return true;
    notes.push_back("the samples keep to the bound, but the file, which is coarser or less precise, has " +
                    exceeded);
    return false;
}

}  // namespace

OutputFile write(Bricks bricks, const std::string& path, const OutputOptions& options,
                 const Execution& execution) {
    checkRanges(options);
    Bricks::Parts& parts = bricks.parts();
    const OutputFormat& format = formatOf(path);
    const VdbLayout layout = layoutOf(options, format);
    OutputShape shape;
    shape.layout = layout;
    shape.layers = options.extend.value_or(layout == VdbLayout::flat ? 1 : 0);
    shape.halfFloat = options.isHalf;
    shape.boundsWorld = parts.refine.boundsWorld;
    shape.maxFlatVoxels = parts.refine.maxVoxels;
    const VdbWriteOptions write = writeOptions(parts, options, layout, shape.layers);
    format.check(write);
    const std::vector<OutputField> outputs = namedFields(parts, options);

    OutputFile file;
    if (layout == VdbLayout::flat)
        if (std::string note = planFlatGrid(parts.result.tree, parts.chosen.channels, shape).note;
            !note.empty())
            file.notes.push_back(std::move(note));
    for (std::size_t f = 0; f < outputs.size(); ++f) parts.result.report.fields[f].name = outputs[f].name;
    shapeForFile(*parts.mesh, parts.chosen.fields, outputs, *parts.resampler, parts.refine.bind, shape,
                 parts.result, execution);
    execution.report(Stage::writing, 0, 1);
    const VdbWriteResult written = format.write(path, outputs, parts.result, write, execution);
    file.bytes = written.fileBytes;
    file.activeVoxels = written.activeVoxels;
    file.notes.insert(file.notes.end(), written.notes.begin(), written.notes.end());
    file.isWithinBound = isFileWithinBound(parts, file.notes);
    file.report = std::move(parts.result.report);
    return file;
}

}  // namespace tessera
