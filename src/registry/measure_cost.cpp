#include "registry/measure_cost.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/timer.h"

namespace tessera {

namespace {

constexpr int kBoxEdge = 32;

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

    TimedWork timed() const { return {{mesh->elementCount(), std::int64_t(edge) * edge * edge}, leastMs}; }
};

double sampleMs(const Resampler& resampler, const BindOptions& options, const Trial& trial,
                const Execution& execution) {
    const Box3d bounds = trial.mesh->boundsWorld();
    const Lattice lattice = Lattice::axisParallel(bounds.min, bounds.size().x / (trial.edge - 1));
    std::vector<IndexBox> boxes;
    for (int z = 0; z < trial.edge; z += kBoxEdge)
        for (int y = 0; y < trial.edge; y += kBoxEdge)
            for (int x = 0; x < trial.edge; x += kBoxEdge)
                boxes.push_back({Vec3i(x, y, z), Vec3i(x, y, z) + kBoxEdge});
    const std::array fields{0};
    const Timer timer;
    resampler.bind(*trial.mesh, fields, options)
        ->resample(
            lattice, boxes, [](std::size_t, const Block&) {}, execution);
    return timer.elapsedMs();
}

}  // namespace

CostModel measureCost(const Resampler& resampler, const BindOptions& options, double budgetMs,
                      const Execution& execution) {
    const TetMesh small = bentCube(8), large = bentCube(20);
    std::array<Trial, 3> trials{Trial{&small, 32}, Trial{&large, 32}, Trial{&small, 64}};
    const Execution silent = execution.withoutProgress();
    sampleMs(resampler, options, trials[0], silent);
    const Timer timer;
    double roundMs = 0;
    for (int round = 0; round < 2 || timer.elapsedMs() + roundMs < budgetMs; ++round) {
        const Timer roundTimer;
        for (Trial& trial : trials)
            trial.leastMs = std::min(trial.leastMs, sampleMs(resampler, options, trial, silent));
        roundMs = roundTimer.elapsedMs();
    }
    return fitCost(trials[0].timed(), trials[1].timed(), trials[2].timed());
}

}  // namespace tessera
