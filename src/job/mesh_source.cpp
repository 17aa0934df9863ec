#include "job/mesh_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "job/field_selection.h"
#include "job/focus_error.h"
#include "mesh/geometry.h"
#include "refine/plan_frame.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {

namespace {

/// A field's component, or a vector's length.
Field scalarOf(const Field& field, std::optional<int> component, const Execution& execution) {
    if (field.components == 1) return field;
    Field scalar{field.name, field.location, 1,
                 std::vector<double>(field.values.size() / std::size_t(field.components))};
    parallelFor(execution.withoutProgress(), std::int64_t(scalar.values.size()), [&](std::int64_t item) {
        double square = 0;
        for (int c = 0; c < field.components; ++c) square += field.at(item, c) * field.at(item, c);
        scalar.values[std::size_t(item)] = component ? field.at(item, *component) : std::sqrt(square);
    });
    return scalar;
}

}  // namespace

MeshSource::MeshSource(const TetMesh& mesh, const Scene& scene, int threads, GlThread& thread,
                       const Execution& execution)
    : threads_(execution.threads), mesh_{mesh.points, mesh.tets, {}} {
    std::vector<FieldChoice> choices;
    if (!scene.field.empty()) choices.push_back({scene.field, scene.field});
    const FieldSelection selection = selectFields(mesh, choices);
    if (selection.fields.empty()) throw InputError("the mesh has no field");
    const OutputField& output = selection.outputs[0];
    for (const Field& field : mesh.fields) {
        const bool isSecond =
            field.location == FieldLocation::cell &&
            mesh.fields[std::size_t(mesh.findField(field.name))].location == FieldLocation::point;
        fieldsThere_.push_back({(isSecond ? "cell:" : "") + field.name, field.components});
    }
    title_ = titleOf(output, scene.component);
    mesh_.fields.push_back(
        scalarOf(mesh.fields[std::size_t(selection.fields[0])], scene.component, execution));
    range_ = finiteFloatRange(mesh_.fields[0], 0);
    if (range_.empty()) throw InputError(fmt::format("{} has no finite value: nothing to draw", title_));
    ScheduleOptions options;
    options.refine.criterion = Criterion::focus;
    options.refine.resolution = scene.bricks.resolution;
    options.refine.brickCells = scene.bricks.cells;
    options.budgetBytes = scene.bricks.budgetBytes;
    options.threads = threads;
    live_ = std::make_unique<LiveBricks>(mesh_, 0, findResampler("software"), options, SampleFormat::r32f,
                                         thread, execution);
    bounds_ = live_->scheduler().frame().meshBoundsWorld;
}

bool MeshSource::setFocus(const Scene& scene) {
    const PlanFrame& frame = live_->scheduler().frame();
    return live_->scheduler().setFocus(
        focusOf(scene.bricks, bounds_, cameraOf(scene, bounds_, 0), frame.spacingWorld(frame.maxDepth)));
}

std::optional<PictureSource::Samples> MeshSource::samplesAt(const Vec3d& placeWorld) const {
    const BrickScheduler& scheduler = live_->scheduler();
    const auto leaf = scheduler.tree().findCovering(finestBrickAt(scheduler.frame(), placeWorld));
    if (!leaf) return std::nullopt;
    return Samples{leaf->key, scheduler.samples(leaf->key)};
}

// The mean of an element's values stands for its volume.
void MeshSource::fill(ValueHistogram& histogram) const {
    const Field& field = mesh_.fields[0];
    const auto valueOf = [&](std::size_t e) {
        if (field.location == FieldLocation::cell) return field.values[e];
        double value = 0;
        for (const std::int32_t node : mesh_.tets[e]) value += 0.25 * field.values[std::size_t(node)];
        return value;
    };
    // Part by part, so that sums don't depend on threads.
    constexpr std::int64_t kPart = 65536;
    const std::int64_t count = mesh_.elementCount();
    std::vector<ValueHistogram> parts(std::size_t((count + kPart - 1) / kPart), histogram);
    parallelFor({.threads = threads_}, std::int64_t(parts.size()), [&](std::int64_t part) {
        for (std::int64_t e = part * kPart; e < std::min((part + 1) * kPart, count); ++e) {
            const auto& tet = mesh_.tets[std::size_t(e)];
            const auto corner = [&](std::size_t c) { return mesh_.points[std::size_t(tet[c])]; };
            parts[std::size_t(part)].add(
                valueOf(std::size_t(e)),
                std::abs(sixfoldVolume(corner(0), corner(1), corner(2), corner(3)).value));
        }
    });
    for (const ValueHistogram& part : parts) histogram.add(part);
}

std::unique_ptr<MeshSource> makeMeshSource(const std::string& path, const TetMesh& mesh, const Scene& scene,
                                           int threads, GlThread& thread, const Execution& execution) {
    try {
        return std::make_unique<MeshSource>(mesh, scene, threads, thread, execution);
    } catch (const InputError& error) {
        throw InputError(path + ": " + error.what());
    }
}

}  // namespace tessera
