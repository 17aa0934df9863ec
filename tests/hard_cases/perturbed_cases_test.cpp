// Elements all but aligned with the lattice, thousands of them. TESSERA_PERTURBED_SEED chooses the first case
// and TESSERA_PERTURBED_CASES how many, for longer hunts.

#include "perturbed_cases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "tessera/registry.h"

namespace tessera::hard_cases {
namespace {

long fromEnvironment(const char* name, long otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atol(text) : otherwise;
}

class PerturbedCases : public testing::TestWithParam<contract::Subject> {};

TEST_P(PerturbedCases, MeetTheContract) {
    const contract::Subject& subject = GetParam();
    TESSERA_CONTRACT_NEEDS(subject);
    const long usual = subject.isOnDevice() ? (subject.isPrimary ? 200 : 50) : 2000;
    const double scale = subject.isOnDevice() ? 1 : std::min(1.0, contract::scale());
    const long count = fromEnvironment("TESSERA_PERTURBED_CASES", std::max(20L, long(double(usual) * scale)));
    const long first = fromEnvironment("TESSERA_PERTURBED_SEED", 1);
    const PerturbedReport report = checkPerturbed(subject, std::uint64_t(first), count);
    std::cout << subject.name << ", seeds " << first << " to " << first + count - 1 << ": "
              << report.total.summary() << "\n";
    EXPECT_EQ(report.unclean, 0) << "first: TESSERA_PERTURBED_SEED=" << report.firstUnclean;
    EXPECT_EQ(report.cases, count);
    EXPECT_GT(report.total.covered, count) << "the lattices lie in the meshes";
}

INSTANTIATE_TEST_SUITE_P(All, PerturbedCases, testing::ValuesIn(contract::subjectsOf(resamplers())),
                         [](const testing::TestParamInfo<contract::Subject>& param) {
                             return param.param.name;
                         });

}  // namespace
}  // namespace tessera::hard_cases
