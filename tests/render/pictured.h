#pragma once

#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "brick_test_meshes.h"
#include "gl_test_tools.h"
#include "pictures/image.h"
#include "reference/ray_cast.h"
#include "refine/plan_frame.h"
#include "render/slice_renderer.h"
#include "schedule/brick_scheduler.h"
#include "software/software_resampler.h"

namespace tessera {

inline constexpr int kCells = 8;
inline constexpr GlPlatform kPlatform = GlPlatform::eglSurfaceless;

/// A mesh whose bricks follow a focus, in a pool, and what draws them.
class Pictured {
  public:
    Pictured(TetMesh made, const std::function<double(const Vec3d&)>& field, const Focus& focus,
             SampleFormat format = SampleFormat::r32f, int resolution = 129,
             const GlContextOptions& context = {})
        : mesh(std::move(made)), thread(kPlatform, context) {
        addPointField(mesh, "other", [](const Vec3d& p) { return p.x; });
        addPointField(mesh, "f", field);
        ScheduleOptions options;
        options.refine.criterion = Criterion::focus;
        options.refine.brickCells = kCells;
        options.refine.resolution = resolution;
        options.refine.focus = {focus};
        options.budgetBytes = std::int64_t(1) << 28;
        const PlanFrame plan = chooseFrame(mesh.boundsWorld(), options.refine);
        frame = {plan.originWorld, plan.rootSpacingWorld, kCells};
        PoolOptions poolOptions;
        poolOptions.budgetBytes = std::int64_t(1) << 26;
        pool = std::make_unique<BrickPool>(thread, kCells,
                                           TexelCoding(codingsOf(mesh, fields, format), format), poolOptions);
        target = std::make_unique<PoolTarget>(*pool, mesh, fields, 2);
        scheduler = std::make_unique<BrickScheduler>(mesh, fields, resampler, options, *target);
        scheduler->finish({.threads = 2});
        bricks = placeBricks(*target, 1);
    }

    RgbaImage draw(const RenderOptions& options, RenderCounts* counts = nullptr) {
        return renderer.draw(*pool, *pool->state(), frame, bricks, options, {}, counts);
    }
    /// What the pool was filled from, in double.
    RayCaster caster() const {
        const Depth finest = scheduler->tree().deepest();
        const BrickTree tree =
            scheduler->tree().brickTree(frame.originWorld, frame.rootSpacingWorld, kCells, finest);
        std::vector<BrickPoints> points(tree.leafCount());
        for (const GrowingLeaf& leaf : scheduler->tree().leaves()) {
            const auto at = tree.findLeaf({levelOf(leaf.key.depth, finest), leaf.key.index});
            const PointValues values =
                target->bricks().valuesAt(leaf, target->bricks().closedPoints(leaf.key));
            BrickPoints& brick = points[std::size_t(at)];
            brick.surface = values.surface;
            for (std::size_t p = 0; p < values.covered.size(); ++p)
                brick.values.push_back(float(values.values[2 * p + 1]));
        }
        return {tree, std::move(points)};
    }
    int depths() const { return scheduler->tree().deepest().halvings() + 1; }

    TetMesh mesh;
    const std::vector<int> fields{0, 1};
    BrickFrame frame;
    SoftwareResampler resampler;
    GlThread thread;
    std::unique_ptr<BrickPool> pool;
    std::unique_ptr<PoolTarget> target;
    std::unique_ptr<BrickScheduler> scheduler;
    SliceRenderer renderer{thread};
    std::vector<PlacedBrick> bricks;
};

inline TransferFunction stops(std::vector<TransferFunction::Stop> all) {
    return {.field = {}, .stops = std::move(all)};
}
inline TransferFunction even(double opacity) {
    return stops({{0, {1, 0.5, 0.25}, opacity}});
}
inline Camera lookAt(const Vec3d& eye, const Vec3d& at, int pixels, double degrees = 35) {
    return {eye, at - eye, {0, 0, 1}, degrees, pixels, pixels};
}

inline double wave(const Vec3d& p) {
    return 0.6 * std::sin(3 * p.x) * std::cos(2 * p.y) + 0.4 * p.z;
}
inline double radiusOf(const Vec3d& p) {
    return glm::length(p);
}

inline void keep(const char* name, const char* which, const RgbaImage& image) {
    // TESSERA_KEEP_PICTURES names a folder to look at them.
    if (const char* folder = std::getenv("TESSERA_KEEP_PICTURES"))
        writePng(std::string(folder) + "/" + name + "_" + which + ".png",
                 overGround(image, {0.15, 0.15, 0.2}));
}

}  // namespace tessera
