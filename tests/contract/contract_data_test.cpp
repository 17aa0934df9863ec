// The contract on real meshes: those bundled with the project, and those of the shared folder where it is
// present.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "contract_suite.h"
#include "mesh_files/read_mesh.h"
#include "reference/fields.h"
#include "tessera/registry.h"

namespace tessera::contract {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> meshFiles() {
    static constexpr const char* kExtensions[] = {".vtu", ".vtk", ".vts"};
    std::vector<fs::path> files;
    for (const char* folder : {TESSERA_DATA_DIR, TESSERA_SHARED_DATA_DIR}) {
        std::error_code error;
        for (const auto& entry : fs::recursive_directory_iterator(folder, error))
            if (std::find(std::begin(kExtensions), std::end(kExtensions), entry.path().extension()) !=
                std::end(kExtensions))
                files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    return files;
}

using OnFile = std::tuple<Subject, fs::path>;

class ContractOnData : public testing::TestWithParam<OnFile> {
  protected:
    void SetUp() override {
        TESSERA_CONTRACT_NEEDS(subject());
        if (isHurried() && isAnotherDevice(subject())) GTEST_SKIP() << "generated meshes have to do there";
        if (isHurried() && subject().isOnDevice() && !subject().isPrimary &&
            (fileNumber() + std::size_t(subject().format)) % 3 != 0)
            GTEST_SKIP() << "other meshes take this format";
        mesh_ = readMesh(std::get<1>(GetParam()), {}, {}).mesh;
        // Every field of every mesh goes through the first device, and one through the others.
        if (subject().isOnDevice() && !subject().isPrimary && mesh_.fields.size() > 1) mesh_.fields.resize(1);
        addElementIdField(mesh_, "element of the test");
        addRandomField(mesh_, "random of the test", FieldLocation::point, 1, 0, 1, 3);
    }
    const Subject& subject() const { return std::get<0>(GetParam()); }
    std::size_t fileNumber() const {
        static const std::vector<fs::path> files = meshFiles();
        return std::size_t(std::find(files.begin(), files.end(), std::get<1>(GetParam())) - files.begin());
    }

    /// About `points` lattice points along the longest axis.
    std::vector<LatticeCase> lattices(int points) const {
        const Vec3d size = mesh_.boundsWorld().size();
        const double longest = std::max({size.x, size.y, size.z});
        return latticesAbout(mesh_, longest / scaledPoints(points), pointsFor(subject(), points));
    }

    TetMesh mesh_;
};

TEST_P(ContractOnData, HasNoHolesSpillOvershootOrWrongValues) {
    ContractReport total;
    std::vector<LatticeCase> cases = lattices(32);
    std::erase_if(cases, [&](const LatticeCase& at) { return !comparesBits(subject(), at); });
    for (const LatticeCase& at : inTurn(subject(), cases, fileNumber()))
        total += expectContract(subject(), mesh_, at);
    EXPECT_GT(total.inMesh, 0);
    RecordProperty("worst_accuracy_ratio", std::to_string(total.worstRatio));
    RecordProperty("covered", std::to_string(total.covered));
}

TEST_P(ContractOnData, GivesTheSameBitsAlways) {
    for (const LatticeCase& at : lattices(40))
        if (at.name == (subject().isOnDevice() && !subject().isPrimary ? "cut plane" : "aligned"))
            expectDeterministic(subject(), mesh_, at);
}

TEST_P(ContractOnData, HoldsAt128PointsAlongTheLongestSide) {
    const std::int64_t every = std::max(1, int(std::lround((subject().isPrimary ? 16 : 64) / scale())));
    const LatticeCase at = latticeOver(mesh_, std::min(128, scaledPoints(128)));
    const ContractReport report = expectContract(subject(), mesh_, at, {.valuesEvery = every});
    EXPECT_GT(report.inMesh, 0);
    RecordProperty("worst_accuracy_ratio", std::to_string(report.worstRatio));
    RecordProperty("covered", std::to_string(report.covered));
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ContractOnData);
INSTANTIATE_TEST_SUITE_P(All, ContractOnData,
                         testing::Combine(testing::ValuesIn(subjectsOf(resamplers())),
                                          testing::ValuesIn(meshFiles())),
                         [](const testing::TestParamInfo<OnFile>& param) {
                             const fs::path& file = std::get<1>(param.param);
                             std::string name = std::get<0>(param.param).name + "_" +
                                                file.parent_path().filename().string() + "_" +
                                                file.filename().string();
                             for (char& c : name)
                                 if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                             return name + "_" + std::to_string(param.index);
                         });

TEST(SharedData, IsThere) {
    if (!fs::exists(TESSERA_SHARED_DATA_DIR))
        GTEST_SKIP() << "no shared meshes at " << TESSERA_SHARED_DATA_DIR;
    EXPECT_GE(meshFiles().size(), 20u);
}

}  // namespace
}  // namespace tessera::contract
