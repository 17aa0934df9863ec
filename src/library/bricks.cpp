#include "tessera/bricks.h"
#include "mesh_files/find_field.h"

#include <cmath>
#include <optional>
#include <utility>

#include "library/brick_parts.h"
#include "library/program.h"
#include "refine/error_samples.h"
#include "refine/plan_frame.h"
#include "schedule/schedule_bricks.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {

namespace {

/// Places further away than that aren't in any brick, whose lattice points have indices within 2^30.
constexpr double kFarthestVoxel = 0x1p30;

RefineOptions refineOptions(const TetMesh& mesh, const ChosenFields& chosen, const BrickOptions& options) {
    if (!options.errorFields.empty() && !options.criterion.has(Criterion::error))
        throw InputError("errorFields need Criterion::error");
    RefineOptions refine;
    refine.criterion = options.criterion;
    refine.brickCells = options.brickCells;
    refine.resolution = options.resolution;
    refine.spacingWorld = options.spacingWorld;
    refine.samplesPerElement = options.samplesPerElement;
    refine.maxLevels = options.maxLevels;
    refine.maxError = options.maxError;
    refine.maxErrorIsRelative = options.maxErrorIsRelative;
    refine.measure = options.errorMeasure;
    for (const std::string& name : options.errorFields)
        refine.errorFields.push_back(findField(mesh, chosen.fields, name));
    refine.focus = options.focus;
    refine.transferFunction = options.transferFunction;
    refine.maxVoxels = options.maxVoxels;
    refine.maxMemoryBytes = options.maxMemoryBytes;
    refine.boundsWorld = options.boundsWorld;
    refine.frame = options.frame;
    refine.bind.target = options.target;
    return refine;
}

std::unique_ptr<Bricks::Parts> makeParts(const TetMesh& mesh, const BrickOptions& options,
                                         const Execution& execution) {
    checkMesh(mesh);
    auto parts = std::make_unique<Bricks::Parts>();
    parts->mesh = &mesh;
    parts->options = options;
    parts->chosen = chooseFields(mesh, options.fields);
    parts->refine = refineOptions(mesh, parts->chosen, options);
    tryDriversFor(options.algorithm, options.maxMemoryBytes);
    WorkSize work;
    if (options.algorithm == "auto")
        work = {mesh.elementCount(), expectedPoints(mesh, meshBounds(mesh, execution), parts->refine)};
    ResamplerChoice choice = chooseResampler(options.algorithm, parts->refine.bind, work, execution);
    parts->result = runChosen(choice, [&](const Resampler& resampler) {
        return makeBricks(mesh, parts->chosen.fields, resampler, parts->refine, execution);
    });
    parts->resampler = choice.resampler;
    parts->options.algorithm = choice.resampler->name();
    parts->options.fields.clear();
    for (const BrickField& field : parts->chosen.described) parts->options.fields.push_back(field.name);
    if (!choice.reason.empty()) parts->result.notes.insert(parts->result.notes.begin(), choice.reason);
    // Names in a mesh needn't be unique.
    for (std::size_t f = 0; f < parts->chosen.described.size(); ++f)
        parts->result.report.fields[f].name = parts->chosen.described[f].name;
    parts->nearest = std::make_shared<const NearestOnDemand>(mesh, execution.threads);
    return parts;
}

}  // namespace

Bricks::Bricks(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Bricks::Bricks(const Bricks& other) : parts_(std::make_unique<Parts>(*other.parts_)) {}
Bricks::Bricks(Bricks&& other) noexcept = default;
Bricks& Bricks::operator=(Bricks other) noexcept {
    parts_.swap(other.parts_);
    return *this;
}
Bricks::~Bricks() = default;

const BrickOptions& Bricks::options() const {
    return parts_->options;
}

FixedFrame Bricks::frame() const {
    return {parts_->result.tree.originWorld(), parts_->result.tree.spacingWorld()};
}

const std::vector<BrickField>& Bricks::fields() const {
    return parts_->chosen.described;
}

const ErrorReport& Bricks::report() const {
    return parts_->result.report;
}

bool Bricks::isWithinBound() const {
    return !parts_->refine.criterion.has(Criterion::error) || parts_->result.bounded;
}

const std::string& Bricks::stoppedBecause() const {
    return parts_->result.stoppedBecause;
}

const std::vector<std::string>& Bricks::notes() const {
    return parts_->result.notes;
}

const ResampleStatistics& Bricks::statistics() const {
    return parts_->result.statistics;
}

std::size_t Bricks::count() const {
    return parts_->result.tree.leafCount();
}

Brick Bricks::brick(std::size_t index) const {
    const BrickTree& tree = parts_->result.tree;
    if (index >= tree.leafCount())
        throw InputError("there is no brick " + std::to_string(index) + "; there are " +
                         std::to_string(tree.leafCount()));
    const BrickKey& key = tree.leaves()[index];
    const double spacing = tree.spacingWorld(key.level);
    const IndexBox points = tree.ownedPoints(key);
    return {
        key.level,
        spacing,
        {tree.originWorld() + spacing * Vec3d(points.min), tree.originWorld() + spacing * Vec3d(points.max)}};
}

Block Bricks::samples(std::size_t index) const {
    const Brick found = brick(index);
    const BrickTree& tree = parts_->result.tree;
    Block block;
    block.lattice = tree.lattice(found.level);
    block.box = tree.ownedPoints(tree.leaves()[index]);
    block.channels = parts_->chosen.channels;
    block.values.assign(std::size_t(block.channels) * block.count(), 0.0f);
    block.coverage.assign(block.count(), 0);
    const int n = parts_->result.store.tilesPerEdge();
    for (int t = 0; t < n * n * n; ++t) {
        const Tile* tile = parts_->result.store.tile(index, t);
        if (!tile) continue;
        const Vec3i first = block.box.min + kTileSize * Vec3i(t / (n * n), t / n % n, t % n);
        for (int i = 0; i < kTilePoints; ++i) {
            if (!tile->covered(i)) continue;
            const std::size_t at = block.offset(first + pointInTile(i));
            block.coverage[at] = 1;
            for (int c = 0; c < block.channels; ++c)
                block.values[std::size_t(c) * block.count() + at] = tile->channel(c)[i];
        }
    }
    return block;
}

int Bricks::channel(const std::string& field, int component) const {
    std::string there;
    for (const BrickField& described : parts_->chosen.described) {
        if (described.name == field && component >= 0 && component < described.components)
            return described.firstChannel + component;
        there += (there.empty() ? "" : ", ") + described.name + " of " + std::to_string(described.components);
    }
    throw InputError("the bricks have no component " + std::to_string(component) + " of a field named '" +
                     field + "'; there are: " + (there.empty() ? "none" : there));
}

std::optional<double> Bricks::value(const Vec3d& placeWorld, int channel) const {
    const BrickTree& tree = parts_->result.tree;
    if (channel < 0 || channel >= parts_->chosen.channels)
        throw InputError("there is no channel " + std::to_string(channel) + "; there are " +
                         std::to_string(parts_->chosen.channels));
    const Vec3d index0 = (placeWorld - tree.originWorld()) / tree.spacingWorld();
    for (int axis = 0; axis < 3; ++axis)
        if (!(std::abs(index0[axis]) < kFarthestVoxel)) return std::nullopt;
    const std::int32_t leaf = leafOfPlace(tree, index0);
    if (leaf < 0) return std::nullopt;
    const Vec3d index = std::ldexp(1.0, -tree.leaves()[std::size_t(leaf)].level) * index0;
    const Reconstruction reconstruction(*parts_->mesh, parts_->chosen.fields, tree, parts_->result.store,
                                        *parts_->nearest);
    return reconstruction.interpolate(std::size_t(leaf), index, channel);
}

Bricks resample(const TetMesh& mesh, const BrickOptions& options, const Execution& execution) {
    return Bricks(makeParts(mesh, options, execution));
}

Bricks resample(const InputMesh& input, const BrickOptions& options, const Execution& execution) {
    std::unique_ptr<Bricks::Parts> parts = makeParts(input.mesh, options, execution);
    parts->sourceFile = input.sourceFile;
    parts->time = input.time;
    return Bricks(std::move(parts));
}

}  // namespace tessera
