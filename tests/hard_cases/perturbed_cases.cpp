#include "perturbed_cases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <mutex>

#include "base/parallel.h"
#include "hard_cases.h"
#include "hard_meshes.h"
#include "mesh/geometry.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "reference/random.h"

namespace tessera::hard_cases {

namespace {

/// In voxels, nodes on integers.
TetMesh integerMesh(Random& random) {
    switch (random.below(5)) {
        case 0:  // a box of Kuhn's tets
        case 1: {
            const Vec3i cells{1 + random.below(2), 1 + random.below(2), 1 + random.below(2)};
            const int step = 1 + random.below(3);
            return boxMesh(
                {.cells = cells, .sizeWorld = Vec3d(cells * step), .isFiveSplit = random.below(2) == 0});
        }
        case 2:  // tets with integer nodes, overlapping
        case 3: {
            TetMesh mesh = integerTetsMesh(2 + random.below(5), 2 + random.below(3), random.next());
            for (std::size_t i = 0; i < mesh.points.size(); ++i) mesh.points[i].x = double(random.below(6));
            return mesh;
        }
        default:  // a fan about one edge, of which the last element closes the ring or not
            TetMesh mesh;
            mesh.points = {{3, 3, 0}, {3, 3, double(1 + random.below(6))}};
            constexpr Vec3i kRing[] = {{6, 3, 1}, {5, 5, 0}, {3, 6, 2}, {0, 5, 1},
                                       {0, 3, 3}, {1, 0, 1}, {4, 0, 0}};
            const int count = 3 + random.below(5);
            for (int i = 0; i < count; ++i) mesh.points.push_back(Vec3d(kRing[i]));
            for (int i = 0; i < count; ++i) mesh.tets.push_back({0, 1, 2 + i, 2 + (i + 1) % count});
            return mesh;
    }
}

/// A length of 1e-17 to 1e-1, each decade as likely as the other.
double perturbation(Random& random) {
    return tenToMinus(1 + random.below(17)) * (0.1 + 0.9 * random.unit());
}

/// By steps of double.
double stepped(double value, int steps) {
    for (int i = 0; i < std::abs(steps); ++i)
        value = std::nextafter(value, steps > 0 ? std::numeric_limits<double>::infinity()
                                                : -std::numeric_limits<double>::infinity());
    return value;
}

void perturb(TetMesh& mesh, Random& random) {
    const double size = perturbation(random);
    const int manner = random.below(5), share = 1 + random.below(3);
    for (Vec3d& p : mesh.points) {
        if (random.below(share) != 0) continue;
        switch (manner) {
            case 0:  // any direction
                p += size * random.offset();
                break;
            case 1:  // along one axis
                p[random.below(3)] += size * random.centred();
                break;
            case 2: {  // a few steps of double
                const int axis = random.below(3);
                p[axis] = stepped(p[axis], random.below(5) - 2);
                break;
            }
            case 3:  // each node by its own size
                p += perturbation(random) * random.offset();
                break;
            default:  // the same for all that move
                p += size * Vec3d(1, -1, 0.5);
        }
    }
}

/// From voxels to the world: any unit, somewhere.
void intoWorld(PerturbedCase& made, Random& random) {
    constexpr double kSpacings[] = {1, 1, 0.5, 1.0 / 3, 0.1, 1e-9, 1e9};
    constexpr double kOffsets[] = {0, 0, 0, 1, 1000, 1e6};
    constexpr double kShifts[] = {0, 0, 0, 0.5, 1.0 / 3};
    const double h = kSpacings[random.below(7)];
    const Vec3d origin = h * kOffsets[random.below(6)] * Vec3d(1, -1, 0.75);
    for (Vec3d& p : made.mesh.points) p = origin + h * p;
    made.at.lattice = Lattice::axisParallel(origin + Vec3d(h * kShifts[random.below(5)]), h);
    const int finer = random.below(4) == 0 ? 2 : 1;
    for (Vec3d* axis : {&made.at.lattice.uWorld, &made.at.lattice.vWorld, &made.at.lattice.wWorld})
        *axis /= double(finer);
    made.at.box = {Vec3i(-1), Vec3i(8)};
    if (finer == 2) made.at.box = {Vec3i(-1), Vec3i(13)};
}

}  // namespace

PerturbedCase perturbedCase(std::uint64_t seed) {
    Random random(seed * 1000003 + 17);
    PerturbedCase made;
    made.at.name = "perturbed";
    made.mesh = integerMesh(random);
    perturb(made.mesh, random);
    intoWorld(made, random);
    addRandomField(made.mesh, "random", FieldLocation::point, 1, 0, 1, random.next());
    addElementIdField(made.mesh, "element");
    return made;
}

PerturbedReport checkPerturbed(const contract::Subject& subject, std::uint64_t first, std::int64_t count) {
    PerturbedReport report;
    std::mutex mutex;
    const auto check = [&](std::uint64_t seed) {
        const PerturbedCase made = perturbedCase(seed);
        const ContractReport one = contract::measureContract(subject, made.mesh, made.at);
        const std::lock_guard lock(mutex);
        report.total += one;
        ++report.cases;
        if (one.isClean()) return;
        if (report.unclean++ == 0 || seed < report.firstUnclean) report.firstUnclean = seed;
    };
    parallelForChunks({}, count, 16, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) check(first + std::uint64_t(i));
    });
    return report;
}

}  // namespace tessera::hard_cases
