// --repair on the gallery of hard cases, at the default threshold: with any loss of volume allowed nothing
// degenerate is left, and the loss is reported; with the default bound the volume is kept, and what can't go
// is reported.

#include <gmpxx.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "hard_cases.h"
#include "mesh/field_range.h"
#include "mesh/geometry.h"
#include "mesh/repair.h"

namespace tessera::hard_cases {
namespace {

class HardCaseRepair : public testing::TestWithParam<HardCase> {
  protected:
    void SetUp() override { mesh_ = GetParam().make(); }

    /// What holds for every repair, whatever it is allowed to lose.
    void expectSound(const TetMesh& repaired, const RepairReport& report) const {
        std::int64_t inverted = 0;
        for (const auto& tet : repaired.tets) {
            const auto at = [&](std::size_t i) -> const Vec3d& {
                return repaired.points[std::size_t(tet[i])];
            };
            inverted += volumeSign(at(0), at(1), at(2), at(3)) < 0;
        }
        EXPECT_EQ(inverted, 0);
        EXPECT_FALSE(report.rangesGrew());
        ASSERT_EQ(repaired.fields.size(), mesh_.fields.size());
        for (std::size_t f = 0; f < mesh_.fields.size(); ++f)
            for (int c = 0; c < mesh_.fields[f].components; ++c) {
                const ValueRange before = fieldRange(mesh_.fields[f], c),
                                 after = fieldRange(repaired.fields[f], c);
                if (after.empty()) continue;
                EXPECT_GE(after.min, before.min) << mesh_.fields[f].name;
                EXPECT_LE(after.max, before.max) << mesh_.fields[f].name;
            }
        EXPECT_EQ(countClasses(repaired, {}, {}).degenerate(), report.keptElements());
        const double before = volumeOf(mesh_), after = volumeOf(repaired);
        EXPECT_NEAR(std::abs(after - before), report.relativeVolumeChange() * before, 1e-9 * before)
            << "what is reported is what happened";
    }

    /// Exact but for one rounding; in double for very many elements, of which only one case has any.
    static double volumeOf(const TetMesh& mesh) {
        double rounded = 0;
        if (mesh.elementCount() > 10000) {
            for (std::int64_t e = 0; e < mesh.elementCount(); ++e) rounded += std::abs(signedVolume(mesh, e));
            return rounded;
        }
        mpq_class sum;
        for (const auto& tet : mesh.tets) {
            std::array<std::array<mpq_class, 3>, 3> edges;
            for (int i = 0; i < 3; ++i)
                for (int a = 0; a < 3; ++a)
                    edges[std::size_t(i)][std::size_t(a)] =
                        mpq_class(mesh.points[std::size_t(tet[std::size_t(i) + 1])][a]) -
                        mpq_class(mesh.points[std::size_t(tet[0])][a]);
            const auto& [u, v, w] = edges;
            sum += abs(u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) +
                       u[2] * (v[0] * w[1] - v[1] * w[0]));
        }
        return mpq_class(sum / 6).get_d();
    }

    TetMesh mesh_;
};

TEST_P(HardCaseRepair, LeavesNothingDegenerateWhereVolumeMayGo) {
    RepairReport report;
    const TetMesh repaired = repair(mesh_, {.limits = {}, .maxVolumeLoss = 1}, report, {});
    expectSound(repaired, report);
    EXPECT_EQ(report.keptElements(), 0) << report.before.degenerate() << " before";
}

TEST_P(HardCaseRepair, KeepsTheVolumeByDefault) {
    RepairReport report;
    const TetMesh repaired = repair(mesh_, {}, report, {});
    expectSound(repaired, report);
    EXPECT_LE(report.relativeVolumeChange(), 1e-6);
    EXPECT_EQ(report.keptElements() > 0, report.keptVolumeWorld > 0) << "what stays is reported";
}

INSTANTIATE_TEST_SUITE_P(All, HardCaseRepair, testing::ValuesIn(hardCases()),
                         [](const testing::TestParamInfo<HardCase>& param) { return param.param.name; });

}  // namespace
}  // namespace tessera::hard_cases
