// Random meshes on random lattices. TESSERA_CONTRACT_SEED chooses the first case and TESSERA_CONTRACT_CASES
// how many, for longer hunts.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "contract_suite.h"
#include "reference/generators.h"
#include "reference/random.h"
#include "tessera/registry.h"

namespace tessera::contract {
namespace {

int fromEnvironment(const char* name, int otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atoi(text) : otherwise;
}

/// 10^x for x uniform between two exponents.
double powerOfTen(Random& random, double least, double most) {
    return std::pow(10.0, least + (most - least) * random.unit());
}

TetMesh randomMesh(Random& random) {
    const std::uint64_t seed = random.next();
    const double aspect = powerOfTen(random, -14, -1);
    switch (random.below(10)) {
        case 0:
            return boxMesh({.cells = {3, 2, 4}, .jitter = 0.3 * random.unit(), .seed = seed});
        case 1:
            return boxMesh({.cells = {2, 3, 2},
                            .sizeWorld = random.place() + 0.1,
                            .isFiveSplit = true,
                            .jitter = 0.2,
                            .seed = seed});
        case 2:
            return gradedDelaunayMesh(80, 1 + 3 * random.unit(), seed);
        case 3:
            return thinTetsMesh(ThinKind(random.below(4)), aspect, 1, 30, seed);
        case 4:
            return thinClusterMesh(aspect, 1 + random.below(2), 40, seed);
        case 5:
            return integerTetsMesh(2 + random.below(5), 8, seed);
        case 6:
            return overlappingMesh(25, seed);
        case 7:
            return dustMesh(Vec3d(0.5), powerOfTen(random, -4, 0), powerOfTen(random, -5, -1), 300, seed);
        case 8:
            return boundaryLayerMesh(2, powerOfTen(random, -9, -1));
        default: {
            TetMesh mesh = hangingNodeMesh(1 + random.below(3), 1 + random.below(4));
            addFlatElements(mesh);
            invertEverySecond(mesh);
            return mesh;
        }
    }
}

void placeAtRandom(TetMesh& mesh, Random& random) {
    if (random.below(3) == 0) return;
    const double size = powerOfTen(random, -9, 9);
    const Vec3d offset = random.below(2) == 0 ? Vec3d(0) : size * powerOfTen(random, -1, 5) * random.offset();
    place(mesh, {size, offset, random.below(2) == 0});
}

/// About a node, an edge's or an element's middle, or anywhere; zoomed in by up to ten powers of ten; mostly
/// axis-parallel.
LatticeCase randomLattice(const TetMesh& mesh, Random& random) {
    const Box3d bounds = mesh.boundsWorld();
    const Vec3d size = bounds.size();
    const double longest = std::max({size.x, size.y, size.z});
    const auto& tet = mesh.tets[std::size_t(random.below(int(mesh.tets.size())))];
    const auto node = [&](std::size_t i) { return mesh.points[std::size_t(tet[i])]; };
    const Vec3d centres[] = {node(0), 0.5 * (node(0) + node(1)),
                             0.25 * (node(0) + node(1) + node(2) + node(3)),
                             bounds.min + size * random.place()};
    const double zoom = random.below(2) == 0 ? 0.1 : powerOfTen(random, -10, -0.5);
    const double h = random.below(4) == 0 ? std::exp2(std::round(std::log2(longest * zoom))) : longest * zoom;
    LatticeCase at{"random", Lattice::axisParallel(centres[random.below(4)], h), {Vec3i(-6), Vec3i(7)}};
    if (random.below(3) == 0) {
        // Origin far off in steps of the lattice, so that indices are large.
        const Vec3i far{random.below(1 << 20), -random.below(1 << 10), random.below(1 << 15)};
        at.lattice.originWorld -= Vec3d(far) * h;
        at.box = {at.box.min + far, at.box.max + far};
    } else if (random.below(3) == 0) {
        const Vec3d u = glm::normalize(random.offset()), v = glm::normalize(cross(u, random.offset()));
        at.lattice.uWorld = h * u;
        at.lattice.vWorld = h * (1 + random.unit()) * v;
        at.lattice.wWorld = h * (1 + random.unit()) * cross(u, v);
        if (random.below(2) == 0) at.box.min.z = 0, at.box.max.z = 1;
    }
    return at;
}

class ContractOnRandomCases : public testing::TestWithParam<Subject> {};

TEST_P(ContractOnRandomCases, HoldsAndIsDeterministic) {
    TESSERA_CONTRACT_NEEDS(GetParam());
    const int first = fromEnvironment("TESSERA_CONTRACT_SEED", 1);
    const int count =
        fromEnvironment("TESSERA_CONTRACT_CASES", int((GetParam().isPrimary ? 150 : 50) * scale()));
    for (int i = first; i < first + count; ++i) {
        Random random(std::uint64_t(i) * 7919);
        TetMesh mesh = randomMesh(random);
        placeAtRandom(mesh, random);
        addTestFields(mesh);
        const LatticeCase at = randomLattice(mesh, random);
        SCOPED_TRACE("TESSERA_CONTRACT_SEED=" + std::to_string(i));
        Subject subject = GetParam();
        subject.route = i % 2 == 0 ? Route::index : Route::pass;
        expectContract(subject, mesh, at);
        if (i % 5 == 0) expectDeterministic(subject, mesh, at);
    }
}

INSTANTIATE_TEST_SUITE_P(All, ContractOnRandomCases, testing::ValuesIn(subjectsOf(resamplers())),
                         [](const testing::TestParamInfo<Subject>& param) { return param.param.name; });

}  // namespace
}  // namespace tessera::contract
