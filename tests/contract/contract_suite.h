#pragma once

#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "contract_cases.h"
#include "reference/check_contract.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

// What the contract tests share: who is tested, and the checks of one subject on one mesh and lattice.

namespace tessera::contract {

/// How much of the suite to run: 1 in a plain build, less under sanitizers; TESSERA_CONTRACT_SCALE overrides.
double scale();

/// Under sanitizers in continuous integration, and on emulated devices when every test runs.
bool isHurried();

/// `points` lattice points along an axis, fewer at a smaller scale.
int scaledPoints(int points);

/// A resampler with a target and a format.
struct Subject {
    const Resampler* resampler = nullptr;
    std::string target;  ///< empty: the default
    SampleFormat format = SampleFormat::r32f;
    /// The first of its resampler. The others meet all meshes, but fewer lattices and points.
    bool isPrimary = true;
    bool isRequired = false;  ///< with TESSERA_REQUIRE_GL=1, to be unavailable is a failure
    std::string name;         ///< "Software", "SlicingOsmesa", "SlicingR8": part of a test's name
    Route route = Route::pass;

    BindOptions bindOptions() const { return {target, format, route}; }
    ContractBounds bounds() const;
    /// Empty when it can run here.
    std::string unavailableReason() const;
    bool isOnDevice() const { return resampler->info().isOnDevice; }
};
/// For listings of tests.
inline void PrintTo(const Subject& subject, std::ostream* out) {
    *out << subject.name;
}

/// The subjects of one resampler: every format on the default target; where targets differ in their bits,
/// besides, r32f on each there may be, available or not (nothing is asked of a driver here, because tests are
/// listed more often than run). Sanitizers see few drivers or none: Mesa isn't built for them.
std::vector<Subject> subjectsOf(const Resampler& resampler);
std::vector<Subject> subjectsOf(std::span<const Resampler* const> resamplers);

/// The arithmetic of the first subject on another platform's device.
bool isAnotherDevice(const Subject& subject);
/// A subject's part of the lattices: all, or about half for one that isn't primary.
bool takes(const Subject& subject, const LatticeCase& at);
/// The lattices on which bits are compared and real meshes checked; fewer on a device, where every run has
/// its price.
bool comparesBits(const Subject& subject, const LatticeCase& at);
/// In a hurry a device takes a third of the cases: one mesh these, the next mesh those, by `turn`.
std::vector<LatticeCase> inTurn(const Subject& subject, const std::vector<LatticeCase>& cases,
                                std::size_t turn);
/// Points along the longest side for a subject.
int pointsFor(const Subject& subject, int points);

struct Sampling {
    BindOptions bind;
    int threads = 1;
};
/// The blocks of several boxes.
std::vector<Block> sample(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                          const Lattice& lattice, std::span<const IndexBox> boxes, const Sampling& sampling);
/// The block of one box.
Block sample(const Subject& subject, const TetMesh& mesh, std::span<const int> fields, const Lattice& lattice,
             const IndexBox& box);

/// Boxes of `edge`^3 points that fill a box; on the upper sides they may be smaller.
std::vector<IndexBox> cut(const IndexBox& box, int edge);

/// Points of `part` whose coverage, or a covered value's bits, differ from those of `whole`, which contains
/// its box.
std::int64_t differences(const Block& part, const Block& whole);

/// Clauses 1 to 5 at every point of one mesh's lattice, for several subjects. Mesh and lattice must outlive
/// it.
class Measure {
  public:
    Measure(const TetMesh& mesh, const LatticeCase& at, const Execution& execution = {});
    ContractReport operator()(const Subject& subject, const Block& block, const CheckOptions& options = {});

  private:
    const LatticeCase& at_;
    Execution execution_;
    Oracle oracle_;
    std::vector<int> fields_;
    std::vector<ReferenceBlock> references_;  ///< one for every tolerance asked for
};

/// The same for a block sampled on the way.
ContractReport measureContract(const Subject& subject, const TetMesh& mesh, const LatticeCase& at,
                               const CheckOptions& options = {});
/// The same; fails the test with the first offence.
ContractReport expectContract(const Subject& subject, const TetMesh& mesh, const LatticeCase& at,
                              const CheckOptions& options = {});

/// Clause 5: the ways of sampling that gave other bits than one box on one thread: threads, bricks, runs,
/// overlapping boxes, other elements elsewhere, and targets where they agree.
std::vector<std::string> findChangedBits(const Subject& subject, const TetMesh& mesh, const LatticeCase& at);
/// Expects none.
void expectDeterministic(const Subject& subject, const TetMesh& mesh, const LatticeCase& at);

}  // namespace tessera::contract

/// In a test or its SetUp: goes on only when the subject can run here.
#define TESSERA_CONTRACT_NEEDS(subject)                                              \
    if (const std::string reason = (subject).unavailableReason(); !reason.empty()) { \
        const char* requireGl = std::getenv("TESSERA_REQUIRE_GL");                   \
        if ((subject).isRequired && requireGl && std::string_view(requireGl) == "1") \
            FAIL() << (subject).name << " is required and can't run: " << reason;    \
        GTEST_SKIP() << (subject).name << ": " << reason;                            \
    }
