#include "registry/measure_cost.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/timer.h"

namespace tessera {

namespace {

constexpr int kBoxEdge = 20;
constexpr int kFewCells = 5, kManyCells = 12;
constexpr double kQuickMs = 0.7;
constexpr double kLeastMs = 1e-3;

/// The unit cube, bent a little so that no face lies along the lattice, with 6 elements a cell.
TetMesh bentCube(int cells) {
    TetMesh mesh;
    const int nodes = cells + 1;
    Field field{"f", FieldLocation::point, 1, {}};
    for (int i = 0; i < nodes * nodes * nodes; ++i) {
        const Vec3d p = Vec3d(i % nodes, i / nodes % nodes, i / (nodes * nodes)) / double(cells);
        mesh.points.push_back(p + 0.03 * Vec3d(std::sin(5 * p.y), std::sin(6 * p.z), std::sin(7 * p.x)));
        field.values.push_back(p.x + p.y * p.z);
    }
    const std::array<std::int32_t, 3> steps{1, nodes, nodes * nodes};
    constexpr int kOrders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    for (int c = 0; c < cells * cells * cells; ++c) {
        const std::int32_t corner = c % cells + nodes * (c / cells % cells + nodes * (c / (cells * cells)));
        for (const auto& order : kOrders) {
            std::array<std::int32_t, 4> tet{corner};
            for (std::size_t k = 0; k < 3; ++k) tet[k + 1] = tet[k] + steps[std::size_t(order[k])];
            mesh.tets.push_back(tet);
        }
    }
    mesh.fields.push_back(std::move(field));
    return mesh;
}

struct Trial {
    const TetMesh* mesh;
    int edge;  // of the lattice, points
    double leastMs = std::numeric_limits<double>::infinity();

    void sample(const Resampler& resampler, const BindOptions& options, const Execution& execution);
    TimedWork timed() const { return {{mesh->elementCount(), std::int64_t(edge) * edge * edge}, leastMs}; }
};

void Trial::sample(const Resampler& resampler, const BindOptions& options, const Execution& execution) {
    const Box3d bounds = mesh->boundsWorld();
    const Lattice lattice = Lattice::axisParallel(bounds.min, bounds.size().x / (edge - 1));
    std::vector<IndexBox> boxes;
    Vec3i p;
    for (p.z = 0; p.z < edge; p.z += kBoxEdge)
        for (p.y = 0; p.y < edge; p.y += kBoxEdge)
            for (p.x = 0; p.x < edge; p.x += kBoxEdge) boxes.push_back({p, p + kBoxEdge});
    const std::array fields{0};
    const Timer timer;
    resampler.bind(*mesh, fields, options)
        ->resample(
            lattice, boxes, [](std::size_t, const Block&) {}, execution);
    leastMs = std::clamp(timer.elapsedMs(), kLeastMs, leastMs);
}

}  // namespace

CostModel measureCost(const Resampler& resampler, const BindOptions& options, double budgetMs,
                      const Execution& execution) {
    const Execution silent = execution.withoutProgress();
    const TetMesh first = bentCube(kFewCells);
    Trial trial{&first, kBoxEdge};
    trial.sample(resampler, options, silent);
    trial.leastMs = std::numeric_limits<double>::infinity();
    trial.sample(resampler, options, silent);
    // The longer it takes, the nearer it is to what large meshes take.
    const int scale = trial.leastMs < kQuickMs ? 2 : 1;
    const TetMesh few = bentCube(scale * kFewCells), many = bentCube(scale * kManyCells);
    const int edge = scale * kBoxEdge;
    std::array<Trial, 4> trials{Trial{&few, edge}, Trial{&many, edge}, Trial{&few, 2 * edge},
                                Trial{&many, 2 * edge}};
    double roundMs = 0;
    Timer timer;
    for (int round = 0; round < 2 || timer.elapsedMs() + roundMs < budgetMs; ++round) {
        if (round == 1) timer.restart();  // by now all shaders are compiled
        const Timer roundTimer;
        for (Trial& one : trials) one.sample(resampler, options, silent);
        roundMs = roundTimer.elapsedMs();
    }
    std::array<TimedWork, 4> timed;
    std::transform(trials.begin(), trials.end(), timed.begin(), [](const Trial& one) { return one.timed(); });
    return fitCost(timed);
}

}  // namespace tessera
