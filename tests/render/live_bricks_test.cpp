#include "render/live_bricks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "refine/camera_view.h"
#include "render/pictured.h"

namespace tessera {
namespace {

constexpr int kPixels = 24;
constexpr double kOpacity = 0.2, kLayer = 0.25;

/// Bricks of a cube that are refined in pieces; every state that is shown is looked at and drawn.
class LiveBricksTest : public testing::Test {
  protected:
    void SetUp() override {
        TESSERA_NEEDS_GL(kPlatform);
        addPointField(mesh_, "x", [](const Vec3d& p) { return p.x; });
        // One opacity, and colours that bricks of all depths have alike, as they have the values of a linear
        // field.
        picture_.camera = lookAt({2.6, 2.1, 1.7}, Vec3d(0.5), kPixels);
        picture_.function = stops({{0, {0, 1, 0.5}, kOpacity}, {1, {1, 0, 0.5}, kOpacity}});
        picture_.layerWorld = kLayer;
        for (int a = 0; a < 3; ++a) {
            Vec3d axis(0);
            axis[a] = 1;
            picture_.within.push_back({axis, 0});
            picture_.within.push_back({-axis, -1});
        }
        thread_ = std::make_unique<GlThread>(kPlatform);
        renderer_ = std::make_unique<SliceRenderer>(*thread_);
    }

    std::unique_ptr<LiveBricks> make(std::int64_t budgetBricks, const Focus& focus) {
        ScheduleOptions options;
        options.refine.criterion = Criterion::focus;
        options.refine.brickCells = kCells;
        options.refine.resolution = 129;
        options.refine.focus = {focus};
        options.budgetBytes = budgetBricks * bytesOfBrick(1, kCells);
        return std::make_unique<LiveBricks>(mesh_, 0, resampler_, options, SampleFormat::r32f, *thread_,
                                            Execution{.threads = 1});
    }

    RgbaImage draw(LiveBricks& live) {
        const std::span<const PlacedBrick> bricks = live.bricks();
        return renderer_->draw(live.pool(), *live.pool().state(), live.frame(), bricks, picture_, {});
    }

    /// The depth shown in each brick of the finest depth inside the cube.
    std::vector<int> depthsShown(LiveBricks& live) {
        const PlanFrame& frame = live.scheduler().frame();
        const double edge = frame.spacingWorld(frame.maxDepth) * kCells;
        const int count = int(std::lround(1 / edge));
        EXPECT_NEAR(count * edge, 1, 1e-9) << "the cube's sides lie between bricks";
        std::vector<int> depths(std::size_t(count * count * count), -1);
        for (const PlacedBrick& brick : live.bricks()) {
            const int times = 1 << (frame.maxDepth - brick.key.depth);
            const Vec3i low = glm::max(brick.key.index * times, Vec3i(0)),
                        high = glm::min((brick.key.index + 1) * times, Vec3i(count));
            for (int z = low.z; z < high.z; ++z)
                for (int y = low.y; y < high.y; ++y)
                    for (int x = low.x; x < high.x; ++x) {
                        int& depth = depths[std::size_t((z * count + y) * count + x)];
                        EXPECT_EQ(depth, -1) << "two bricks are shown in one place";
                        depth = brick.key.depth.halvings();
                    }
        }
        EXPECT_TRUE(std::ranges::none_of(depths, [](int depth) { return depth < 0; })) << "a hole";
        return depths;
    }

    /// Every pixel stops the light that its ray through the cube loses, and has the colours of the values.
    void expectNoHole(const RgbaImage& image, const RgbaImage& converged) {
        const CameraView view = viewOf(picture_.camera);
        double worst = 0, worstColour = 0;
        for (int y = 0; y < kPixels; ++y)
            for (int x = 0; x < kPixels; ++x) {
                const ViewRay ray = view.rayOf(picture_.camera, x, y);
                double begin = 0, end = 1e9;
                for (int a = 0; a < 3; ++a) {
                    const double s = -ray.originWorld[a] / ray.direction[a],
                                 t = (1 - ray.originWorld[a]) / ray.direction[a];
                    begin = std::max(begin, std::min(s, t));
                    end = std::min(end, std::max(s, t));
                }
                const double opacity = 1 - std::pow(1 - kOpacity, std::max(0.0, end - begin) / kLayer);
                worst = std::max(worst, std::abs(double(image.at(x, y)[3]) - opacity));
                for (std::size_t c = 0; c < 3; ++c)
                    worstColour = std::max(
                        worstColour, std::abs(double(image.at(x, y)[c]) - double(converged.at(x, y)[c])));
            }
        EXPECT_LT(worst, 0.1 / 255);
        EXPECT_LT(worstColour, 0.1 / 255);
    }

    /// Works until all is at rest, and looks at every state. What is shown may become coarser only where what
    /// is shown at rest is: nothing is taken back that the plan wants.
    void refine(LiveBricks& live) {
        std::vector<std::vector<int>> depths;
        std::vector<RgbaImage> pictures;
        if (live.pool().state()) depths.push_back(depthsShown(live));
        std::int64_t number = live.pool().state() ? live.pool().state()->number : 0;
        for (bool isAtRest = false; !isAtRest && !HasFatalFailure();) {
            isAtRest = live.update(BrickScheduler::Clock::now(), {.threads = 1});
            const auto state = live.pool().state();
            if (!state || state->number == number) continue;
            number = state->number;
            depths.push_back(depthsShown(live));
            pictures.push_back(draw(live));
        }
        ASSERT_FALSE(pictures.empty());
        states_ += int(pictures.size());
        for (const RgbaImage& picture : pictures) expectNoHole(picture, pictures.back());
        for (std::size_t state = 1; state < depths.size(); ++state)
            for (std::size_t place = 0; place < depths[state].size(); ++place) {
                const int asked = std::min(depths[state - 1][place], depths.back()[place]);
                ASSERT_GE(depths[state][place], asked) << "a step back, in state " << state;
            }
    }

    /// What is shown at rest doesn't tell how it came there.
    void expectAsMadeAnew(LiveBricks& live, std::int64_t budgetBricks, const Focus& focus) {
        const std::unique_ptr<LiveBricks> anew = make(budgetBricks, focus);
        anew->scheduler().finish({.threads = 2});
        const RgbaImage a = draw(live), b = draw(*anew);
        EXPECT_EQ(a.pixels, b.pixels);
    }

    TetMesh mesh_ = gridMesh({5, 5, 5}, Vec3d(0), Vec3d(1));
    SoftwareResampler resampler_;
    std::unique_ptr<GlThread> thread_;
    std::unique_ptr<SliceRenderer> renderer_;
    RenderOptions picture_;
    int states_ = 0;
};

TEST_F(LiveBricksTest, NoFrameShowsAHoleOrAStepBack) {
    constexpr std::int64_t kAmple = 2000, kFew = 300;
    const Focus first = pointFocus({0.3, 0.2, 0.1}, 0.1), second = pointFocus({0.8, 0.7, 0.9}, 0.1);
    const std::unique_ptr<LiveBricks> live = make(kAmple, first);
    refine(*live);
    expectAsMadeAnew(*live, kAmple, first);
    ASSERT_TRUE(live->scheduler().setFocus({second}));
    refine(*live);
    expectAsMadeAnew(*live, kAmple, second);
    live->scheduler().setBudget(kFew * bytesOfBrick(1, kCells));
    refine(*live);
    EXPECT_TRUE(live->scheduler().isCutShort());
    expectAsMadeAnew(*live, kFew, second);
    ASSERT_TRUE(live->scheduler().setFocus({first}));
    refine(*live);
    expectAsMadeAnew(*live, kFew, first);
    live->scheduler().setBudget(kAmple * bytesOfBrick(1, kCells));
    refine(*live);
    expectAsMadeAnew(*live, kAmple, first);
    EXPECT_GT(states_, 100);
}

}  // namespace
}  // namespace tessera
