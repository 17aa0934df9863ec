#include "benchmark/picture_errors.h"

#include <algorithm>
#include <cmath>

#include "base/timer.h"
#include "files/temporary_folder.h"
#include "job/mesh_source.h"
#include "job/scene_picture.h"
#include "job/vdb_source.h"
#include "reference/mesh_cast.h"
#include "reference/ray_cast.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_write.h"

namespace tessera {

namespace {

/// Pixels around a silhouette that count as beside it.
constexpr int kBeside = 4;
/// Of rays that are cut with the mesh.
constexpr double kStepVoxels = 0.25;

GlThread& pictureThread() {
    return sharedGlThread(chooseGlPlatform({}));
}

Scene sceneOf(const std::string& field, int sizePixels) {
    Scene scene;
    scene.field = field;
    scene.width = scene.height = sizePixels;
    scene.samplesAPixel = 1;
    scene.hasLegend = false;
    return scene;
}

RenderOptions clippedTo(const Box3d& bounds, RenderOptions options) {
    for (int a = 0; a < 3; ++a) {
        Vec3d axis(0);
        axis[a] = 1;
        options.within.push_back({axis, bounds.min[a]});
        options.within.push_back({-axis, -bounds.max[a]});
    }
    return options;
}

}  // namespace

PictureReference::PictureReference(const TetMesh& mesh, const std::string& field, int sizePixels,
                                   const Execution& execution, Keep keep)
    : scene_(sceneOf(field, sizePixels)),
      source_(std::make_unique<MeshSource>(mesh, scene_, 0, pictureThread(), execution)),
      picture_(std::make_unique<RenderOptions>(pictureOf(scene_, *source_, false).options)),
      nearest_(std::make_unique<NearestOnDemand>(source_->mesh(), execution.threads)),
      rays_(std::make_unique<MeshRays>(source_->mesh(), picture_->camera, execution)),
      renderer_(std::make_unique<SliceRenderer>(pictureThread())),
      keep_(std::move(keep)) {
    const auto partsAt = [&](int x, int y) { return rays_->spans(x, y).size(); };
    for (int y = 0; y < sizePixels; ++y)
        for (int x = 0; x < sizePixels; ++x) {
            bool isInside = partsAt(x, y) > 0;
            meshCount_ += isInside;
            const int right = std::min(sizePixels - 1, x + kBeside);
            for (int j = std::max(0, y - kBeside); j <= std::min(sizePixels - 1, y + kBeside); ++j)
                for (int i = std::max(0, x - kBeside); isInside && i <= right; ++i)
                    isInside = partsAt(i, j) == partsAt(x, y);
            insideCount_ += isInside;
            inside_.push_back(isInside);
        }
    const Timer timer;
    exact_ = castMesh(source_->mesh(), picture_->camera,
                      {.function = picture_->function, .layerWorld = picture_->layerWorld}, execution);
    exactMs_ = timer.elapsedMs();
    if (keep_) keep_("exact", exact_);
}

PictureReference::~PictureReference() = default;

const TetMesh& PictureReference::mesh() const {
    return source_->mesh();
}

const std::string& PictureReference::title() const {
    return source_->title();
}

PictureDifference PictureReference::differenceTo(const RgbaImage& image) const {
    double all = 0, inside = 0;
    for (std::size_t p = 0; p < image.pixels.size(); ++p)
        for (std::size_t c = 0; c < 3; ++c) {
            const double apart = 255 * (double(image.pixels[p][c]) - double(exact_.pixels[p][c]));
            all += apart * apart;
            if (inside_[p]) inside += apart * apart;
        }
    const auto root = [](double sum, std::int64_t pixels) {
        return std::sqrt(sum / (3 * double(std::max<std::int64_t>(pixels, 1))));
    };
    return {root(all, meshCount_), root(inside, insideCount_)};
}

PictureErrors PictureReference::measure(const Resampler& resampler, const RefineOptions& refine,
                                        BrickResult& result, const std::string& name,
                                        const Execution& execution, bool isAll) const {
    const std::vector<int> fields{0};
    const Field& field = mesh().fields[0];
    PictureErrors errors;
    const Timer timer;
    const std::vector<OutputField> outputs{
        {"f", field.name, field.location == FieldLocation::cell ? "cell" : "point", 1, 0}};
    OutputShape shape;
    shape.layers = 1;
    shapeForFile(mesh(), fields, outputs, resampler, refine.bind, shape, result, execution);
    errors.extendMs = timer.elapsedMs();
    if (isAll) {
        const RayCaster caster(result.tree, {mesh(), fields, result.tree, result.store, *nearest_}, 0,
                               execution);
        errors.values = differenceTo(
            caster.draw(*rays_, picture_->function,
                        {.layerWorld = picture_->layerWorld, .stepVoxels = kStepVoxels}, execution));
    }

    const TemporaryFolder folder("tessera-picture");
    const std::string path = folder.pathOf("bricks.vdb");
    VdbWriteOptions write;
    write.layers = shape.layers;
    writeVdb(path, outputs, result, write, execution);
    Job job;
    job.execution = execution;
    const auto source = openVdbSource(path, "", {}, pictureThread(), job);
    const auto draw = [&](const RenderOptions& options) {
        RenderCounts counts;
        RgbaImage image = renderer_->draw(source->pool(), *source->pool().state(), source->frame(),
                                          source->bricks(), options, execution, &counts);
        errors.drawMs = counts.drawMs;
        return image;
    };
    // First, so that shaders are made when the time of drawing counts.
    if (isAll) errors.clipped = differenceTo(draw(clippedTo(source_->boundsWorld(), *picture_)));
    const RgbaImage drawn = draw(*picture_);
    errors.drawn = differenceTo(drawn);
    if (keep_) keep_(name, drawn);
    return errors;
}

}  // namespace tessera
