// What frames of a viewer cost, at rest and while bricks are refined: view_frames mesh.vtu [--field NAME]
// [--width 920] [--height 760] [--frames 60] [--resolution 512] [--scene scene.json] [--reader tessera]
//
// The camera turns around the data. First everything is refined: frames of an idle session, then so many
// again. Then the bricks are forgotten but for the coarsest, and the focus is moved at every tenth frame, so
// that bricks are sampled all the time: the same frames. Beside that the bricks a second that an idle machine
// publishes without frames, and those published between frames.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "reader/isolated_reader.h"
#include "view/view_session.h"

namespace {

using namespace tessera;

struct Options {
    std::string mesh, field, scene, reader;
    int width = 920, height = 760, frames = 60, resolution = 512;
    double frameMs = 0;
};

double quantile(std::vector<double> values, double share) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[std::min(values.size() - 1, std::size_t(share * double(values.size())))];
}

void run(const Options& options) {
    Job job;
    if (!options.reader.empty())
        job.reader = {options.reader, {"read-mesh"}, quickReaderBeside(options.reader)};
    ViewSession session(job, {.platform = {}, .frameMs = options.frameMs});
    if (!options.scene.empty()) session.document() = SceneDocument::read(options.scene);
    SceneDocument::Json json = session.document().json();
    if (!options.field.empty()) json["field"] = options.field;
    if (!json.contains("bricks")) json["bricks"] = {{"resolution", options.resolution}};
    session.document().change(json);
    session.resize(options.width, options.height);
    const auto began = ViewSession::Clock::now();
    const auto msSince = [](ViewSession::Clock::time_point from) {
        return std::chrono::duration<double, std::milli>(ViewSession::Clock::now() - from).count();
    };
    session.open(options.mesh);
    while (session.isOpening() && !session.source()) {
        session.work(nullptr);
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    while (session.pictureNumber() == 0) session.work(nullptr);
    const double firstMs = msSince(session.readAt());
    const auto ms = [](auto duration) { return std::chrono::duration<double, std::milli>(duration).count(); };
    const double madeMs = ms(session.madeAt() - session.readAt()),
                 coarsestMs = ms(session.coarsestAt() - session.madeAt());
    fmt::print(
        "{}: read after {:.0f} ms; then index {:.0f} ms, coarsest bricks {:.0f}, first picture {:.0f}: "
        "{:.0f} "
        "ms in all\n",
        options.mesh, ms(session.readAt() - began), madeMs, coarsestMs, firstMs - madeMs - coarsestMs,
        firstMs);
    while (!session.hasConverged()) session.work(nullptr);
    fmt::print("converged {:.0f} ms after reading\n", msSince(session.readAt()));
    for (const std::string& message : session.takeMessages()) fmt::print("{}\n", message);
    BrickScheduler& scheduler = session.mesh()->live().scheduler();
    const Box3d bounds = session.source()->boundsWorld();

    // Places from where to look, and where the focus moves to.
    const ViewCamera first = session.viewCamera();
    const auto look = [&](int frame) {
        ViewCamera camera = first;
        camera.orbit(2.0 * frame / options.frames, 0.1 * std::sin(0.2 * frame));
        SceneDocument::Json to = session.document().json();
        to["camera"] = camera.json();
        session.document().drag(std::move(to));
        session.touch();
    };
    const auto move = [&](int place) {
        Vec3d at;
        for (int a = 0; a < 3; ++a) {
            const double share =
                std::fmod(0.5 + (place + 1) * std::array{0.618034, 0.754878, 0.569840}[std::size_t(a)], 1.0);
            at[a] = bounds.min[a] + (0.2 + 0.6 * share) * (bounds.max[a] - bounds.min[a]);
        }
        SceneDocument::Json to = session.document().json();
        to["bricks"]["focus"] = {{{"place", {at.x, at.y, at.z}}}};
        session.document().drag(std::move(to));
    };
    std::vector<double> drawMs, cycleMs;
    std::int64_t published = 0;
    double publishingMs = 0;
    const auto frames = [&](bool refines) {
        drawMs.clear(), cycleMs.clear();
        session.takeFrames();
        const std::int64_t before = scheduler.counts().sampled;
        const Timer whole;
        for (int frame = 0; frame < options.frames; ++frame) {
            if (refines && frame % 10 == 0) {
                scheduler.forget();
                move(frame / 10);
            }
            look(frame);
            const Timer cycle;
            while (session.work(nullptr) != ViewSession::Did::drew) {
            }
            cycleMs.push_back(cycle.elapsedMs());
        }
        published = scheduler.counts().sampled - before;
        publishingMs = whole.elapsedMs();
        double scale = 0;
        for (const FrameTime& frame : session.takeFrames()) drawMs.push_back(frame.ms), scale += frame.scale;
        fmt::print(
            "{:9} frames: drawn in {:.1f} ms, 99 % {:.1f}; from one to the next {:.1f} ms, 99 % {:.1f}; at "
            "{:.0f} %\n",
            refines ? "refining" : "idle", quantile(drawMs, 0.5), quantile(drawMs, 0.99),
            quantile(cycleMs, 0.5), quantile(cycleMs, 0.99), 100 * scale / double(drawMs.size()));
        return std::pair(quantile(cycleMs, 0.5), quantile(cycleMs, 0.99));
    };
    frames(false);
    const auto idle = frames(false);
    const auto refining = frames(true);
    const double withFrames = 1000 * double(published) / publishingMs;
    // Without frames.
    std::int64_t alone = 0;
    const Timer timer;
    for (int place = 0; place < 6; ++place) {
        scheduler.forget();
        const std::int64_t before = scheduler.counts().sampled;
        SceneDocument::Json to = session.document().json();
        move(place);
        session.mesh()->setFocus(session.document().scene());
        const Timer since;
        while (!session.mesh()->live().update(BrickScheduler::Clock::now() + std::chrono::milliseconds(20),
                                              {}) &&
               since.elapsedMs() < publishingMs / 6) {
        }
        alone += scheduler.counts().sampled - before;
    }
    const double idleRate = 1000 * double(alone) / timer.elapsedMs();
    fmt::print("{} bricks; ", session.source()->bricks().size());
    fmt::print("refining over idle: median {:.2f}, 99 % {:.2f}; {:.0f} of {:.0f} bricks a second, {:.0f} %\n",
               refining.first / idle.first, refining.second / idle.second, withFrames, idleRate,
               100 * withFrames / idleRate);
}

}  // namespace

int main(int count, char** words) {
    Options options;
    bench::Arguments arguments("What frames of a viewer cost, at rest and while bricks are refined");
    arguments.addNeeded("mesh", options.mesh, "a mesh file");
    arguments.add("--field", options.field, "its name; without, the first");
    arguments.add("--reader", options.reader, "the tessera program, which reads in a process of its own");
    arguments.add("--scene", options.scene, "a scene");
    arguments.add("--width", options.width, "pixels", {64, 8192});
    arguments.add("--height", options.height, "pixels", {64, 8192});
    arguments.add("--frames", options.frames, "", {10, 100000});
    arguments.add("--resolution", options.resolution, "of the finest spacing", {2, 1 << 20});
    arguments.add("--frame-time", options.frameMs, "milliseconds that a frame may take");
    return arguments.run(count, words, [&] {
        run(options);
        return 0;
    });
}
