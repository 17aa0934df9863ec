// The gallery of hard cases: clauses 1 to 5 for every algorithm, device and format on coarse lattices
// (accuracy_table runs the fine ones), and the software resampler's bits against hash_list.txt.
// TESSERA_WRITE_HASHES=file writes that list anew.

#include "hard_cases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "mesh/element_class.h"
#include "tessera/registry.h"

namespace tessera::hard_cases {
namespace {

using contract::LatticeCase;
using contract::Subject;

const std::vector<Subject>& subjects() {
    static const std::vector<Subject> all = contract::subjectsOf(resamplers());
    return all;
}

constexpr const char* kThinTitles[] = {"Needles", "Spindles", "Slivers", "Caps"};

/// A case of thin elements of one shape, which is named after their aspect ratio.
bool isThinKind(const HardCase& hardCase) {
    return hardCase.name.find("1e") != std::string::npos &&
           std::any_of(std::begin(kThinTitles), std::end(kThinTitles),
                       [&](const char* title) { return hardCase.name.starts_with(title); });
}

using OnCase = std::tuple<Subject, HardCase>;

class HardCases : public testing::TestWithParam<OnCase> {
  protected:
    void SetUp() override {
        TESSERA_CONTRACT_NEEDS(subject());
        if (hardCase().isLarge && (!subject().isPrimary || contract::isHurried())) GTEST_SKIP() << "large";
        if (contract::isHurried() && contract::isAnotherDevice(subject()))
            GTEST_SKIP() << "another device of the same arithmetic";
        mesh_ = hardCase().make();
    }
    const Subject& subject() const { return std::get<0>(GetParam()); }
    const HardCase& hardCase() const { return std::get<1>(GetParam()); }
    /// All offsets for the software resampler at 16 and 32 cells; on devices fewer, since they are emulated.
    std::vector<LatticeCase> lattices() const {
        std::vector<LatticeCase> lattices = latticesOf(mesh_, 16);
        if (subject().isOnDevice()) {
            if (subject().isPrimary) return {lattices.front(), lattices.back()};
            return {lattices[lattices.size() / 2]};
        }
        if (!hardCase().isLarge)
            for (const LatticeCase& at : latticesOf(mesh_, 32)) lattices.push_back(at);
        return lattices;
    }

    TetMesh mesh_;
};

TEST_P(HardCases, MeetTheContract) {
    for (const LatticeCase& at : lattices()) {
        const std::vector<int> fields = everyField(mesh_);
        const Block block = contract::sample(subject(), mesh_, fields, at.lattice, at.box);
        const ContractReport report = contract::Measure(mesh_, at)(subject(), block);
        EXPECT_TRUE(report.isClean())
            << hardCase().sentence << "; lattice " << at.name << "\n  " << report.summary();
        if (hardCase().isConstant) {
            EXPECT_EQ(wrongConstants(mesh_, block), 0) << at.name;
        }
    }
}

TEST_P(HardCases, ThinnestElementsAreMet) {
    if (hardCase().isLarge) GTEST_SKIP() << "large";
    const std::vector<LatticeCase> lattices = latticesThroughThinnest(mesh_, subject().isOnDevice() ? 2 : 8);
    const std::vector<int> fields = everyField(mesh_);
    for (const LatticeCase& at : lattices) {
        const Block block = contract::sample(subject(), mesh_, fields, at.lattice, at.box);
        const ContractReport report = contract::Measure(mesh_, at)(subject(), block);
        EXPECT_TRUE(report.isClean())
            << hardCase().sentence << "; lattice " << at.name << "\n  " << report.summary();
        EXPECT_GT(report.inMesh, 0) << at.name;
        EXPECT_EQ(block.coverage[block.offset(Vec3i(0))], 1) << at.name;
    }
    EXPECT_TRUE(!lattices.empty() || !isThinKind(hardCase())) << "no thin element has a point inside";
}

/// On devices, of which none promises the bits of another: the same device, the same bits. The others' are
/// listed.
class HardCaseBits : public testing::TestWithParam<OnCase> {};

TEST_P(HardCaseBits, AreTheSameAlways) {
    const auto& [subject, hardCase] = GetParam();
    TESSERA_CONTRACT_NEEDS(subject);
    if (hardCase.isLarge) GTEST_SKIP() << "large";
    const TetMesh mesh = hardCase.make();
    contract::expectDeterministic(subject, mesh, latticesOf(mesh, 16).back());
}

std::vector<Subject> firstOnDevices() {
    std::vector<Subject> first;
    for (const Subject& subject : subjects())
        if (subject.isPrimary && subject.isOnDevice()) first.push_back(subject);
    return first;
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(HardCaseBits);
INSTANTIATE_TEST_SUITE_P(All, HardCaseBits,
                         testing::Combine(testing::ValuesIn(firstOnDevices()),
                                          testing::ValuesIn(hardCases())),
                         [](const testing::TestParamInfo<OnCase>& param) {
                             return std::get<0>(param.param).name + std::get<1>(param.param).name;
                         });

INSTANTIATE_TEST_SUITE_P(All, HardCases,
                         testing::Combine(testing::ValuesIn(subjects()), testing::ValuesIn(hardCases())),
                         [](const testing::TestParamInfo<OnCase>& param) {
                             return std::get<0>(param.param).name + std::get<1>(param.param).name;
                         });

/// 64 bits of Fowler, Noll and Vo's hash (FNV-1a) over coverage and covered values, point by point.
class Hash {
  public:
    void add(const Block& block) {
        for (std::size_t i = 0; i < block.count(); ++i) {
            byte(block.coverage[i]);
            if (block.coverage[i] == 0) continue;
            for (int c = 0; c < block.channels; ++c) {
                std::uint32_t bits;
                std::memcpy(&bits, &block.channel(c)[i], sizeof bits);
                for (int shift = 0; shift < 32; shift += 8) byte(std::uint8_t(bits >> shift));
            }
        }
    }
    std::string text() const {
        char digits[17];
        std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(state_));
        return digits;
    }

  private:
    void byte(std::uint8_t b) { state_ = (state_ ^ b) * 0x100000001b3u; }
    std::uint64_t state_ = 0xcbf29ce484222325u;
};

std::string hashListPath() {
    return TESSERA_SOURCE_DIR "/tests/hard_cases/hash_list.txt";
}

const std::map<std::string, std::string>& hashList() {
    static const std::map<std::string, std::string> list = [] {
        std::map<std::string, std::string> hashes;
        std::ifstream file(hashListPath());
        for (std::string line; std::getline(file, line);) {
            if (line.empty() || line[0] == '#') continue;
            std::istringstream words(line);
            std::string name, hash;
            words >> name >> hash;
            hashes[name] = hash;
        }
        return hashes;
    }();
    return list;
}

/// One block of the whole box, put together from those of smaller boxes.
Block assembled(const LatticeCase& at, const std::vector<Block>& parts) {
    Block whole;
    whole.lattice = at.lattice, whole.box = at.box, whole.channels = parts.front().channels;
    whole.coverage.assign(whole.count(), 2);
    whole.values.assign(whole.count() * std::size_t(whole.channels), 0);
    for (const Block& part : parts) {
        Vec3i p;
        for (p.z = part.box.min.z; p.z < part.box.max.z; ++p.z)
            for (p.y = part.box.min.y; p.y < part.box.max.y; ++p.y)
                for (p.x = part.box.min.x; p.x < part.box.max.x; ++p.x) {
                    const std::size_t to = whole.offset(p);
                    whole.coverage[to] = part.coverage[part.offset(p)];
                    for (int c = 0; c < whole.channels; ++c)
                        whole.values[std::size_t(c) * whole.count() + to] = part.value(c, p);
                }
    }
    return whole;
}

class HardCaseHashes : public testing::TestWithParam<HardCase> {};

TEST_P(HardCaseHashes, AreThoseListed) {
    if (contract::isHurried() && GetParam().isLarge) GTEST_SKIP() << "large";
    const TetMesh mesh = GetParam().make();
    const std::vector<int> fields = everyField(mesh);
    const Resampler& software = findResampler("software");
    struct Way {
        std::string target;
        int threads, edge;
        Route route = Route::pass;
    };
    std::vector<Way> ways;
    for (const std::string& target : software.targets()) ways.push_back({target, 2, 32});
    if (contract::isHurried()) {
        ways.push_back({software.targets().front(), 5, 8, Route::index});
    } else {
        for (const int threads : {1, 2, 5, 16}) ways.push_back({software.targets().front(), threads, 16});
        for (const int edge : {8, 64})
            for (const Route route : {Route::pass, Route::index})
                ways.push_back({software.targets().front(), 5, edge, route});
    }

    const std::vector<LatticeCase> coarse = latticesOf(mesh, 16);
    std::vector<LatticeCase> lattices{coarse.front(), coarse.back()};
    if (!GetParam().isLarge) lattices.push_back(latticesOf(mesh, 32).back());
    std::string first;
    for (const Way& way : ways) {
        Hash hash;
        for (const LatticeCase& at : lattices)
            hash.add(assembled(
                at, contract::sample(software, mesh, fields, at.lattice, contract::cut(at.box, way.edge),
                                     {{.target = way.target, .route = way.route}, way.threads})));
        if (first.empty()) first = hash.text();
        EXPECT_EQ(hash.text(), first)
            << way.target << ", " << way.threads << " threads, boxes of " << way.edge;
    }
    if (const char* path = std::getenv("TESSERA_WRITE_HASHES")) {
        std::ofstream(path, std::ios::app) << GetParam().name << " " << first << "\n";
        return;
    }
    ASSERT_TRUE(hashList().contains(GetParam().name)) << hashListPath() << " has no hash " << first;
    EXPECT_EQ(first, hashList().at(GetParam().name));
}

INSTANTIATE_TEST_SUITE_P(Software, HardCaseHashes, testing::ValuesIn(hardCases()),
                         [](const testing::TestParamInfo<HardCase>& param) { return param.param.name; });

TEST(HardCaseList, HasEachNameOnceAndNoHashTooMany) {
    std::map<std::string, int> names;
    for (const HardCase& hardCase : hardCases()) EXPECT_EQ(++names[hardCase.name], 1) << hardCase.name;
    for (const auto& [name, hash] : hashList())
        EXPECT_TRUE(names.contains(name)) << name << " in " << hashListPath();
}

TEST(HardCaseList, ThinElementsAreAsThinAsTheirNamesSay) {
    int checked = 0;
    for (const HardCase& hardCase : hardCases()) {
        if (!isThinKind(hardCase)) continue;
        const TetMesh mesh = hardCase.make();
        double least = 1;
        for (std::int64_t e = 0; e < mesh.elementCount(); ++e)
            least = std::min(least, aspectOf(cornersOf(mesh, e)));
        const double named = std::pow(10.0, -std::stoi(hardCase.name.substr(hardCase.name.find("1e") + 2)));
        EXPECT_GT(least, 0.01 * named) << hardCase.name;
        EXPECT_LT(least, 10 * named) << hardCase.name;
        ++checked;
    }
    EXPECT_EQ(checked, 60) << "four kinds, three surroundings, five aspect ratios";
}

}  // namespace
}  // namespace tessera::hard_cases
