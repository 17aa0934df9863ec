#include "contract_suite.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <utility>

#include "base/parallel.h"
#include "base/sanitizers.h"
#include "reference/fields.h"
#include "reference/generators.h"

namespace tessera::contract {

double scale() {
    static const double value = [] {
        const char* text = std::getenv("TESSERA_CONTRACT_SCALE");
        const double given = text ? std::atof(text) : 0;
        return given > 0 ? given : kIsSanitized ? 0.2 : 1.0;
    }();
    return value;
}

int scaledPoints(int points) {
    return std::max(5, int(std::lround(points * std::cbrt(scale()))));
}

bool isHurried() {
    return scale() < 0.2;
}

bool isAnotherDevice(const Subject& subject) {
    return subject.isOnDevice() && !subject.isPrimary && subject.format == SampleFormat::r32f;
}

ContractBounds Subject::bounds() const {
    return {resampler->info().spillBoundVoxels, resampler->info().placeBoundVoxels, format};
}

std::string Subject::unavailableReason() const {
    std::string reason = resampler->unavailableReason();
    if (!reason.empty() || target.empty()) return reason;
    const std::vector<std::string> targets = resampler->targets();
    if (std::find(targets.begin(), targets.end(), target) != targets.end()) return {};
    try {
        resampler->bind(TetMesh{}, {}, {.target = target});
    } catch (const std::exception& error) {
        return error.what();
    }
    return "target " + target + " isn't listed";
}

namespace {

/// "egl-surfaceless" -> "EglSurfaceless".
std::string camel(std::string_view words) {
    std::string text;
    bool isFirst = true;
    for (const char c : words) {
        const bool isLetter = std::isalnum(static_cast<unsigned char>(c)) != 0;
        if (isLetter) text += isFirst ? char(std::toupper(static_cast<unsigned char>(c))) : c;
        isFirst = !isLetter;
    }
    return text;
}

/// The devices that a resampler may run on. The first two are what Mesa gives everywhere; the third stands
/// for hardware, which a machine may lack.
struct DeviceTarget {
    const char* name;
    bool isRequired;
};
constexpr DeviceTarget kDeviceTargets[] = {
    {"egl-surfaceless", true}, {"osmesa", true}, {"egl-device", false}};

}  // namespace

std::vector<Subject> subjectsOf(const Resampler& resampler) {
    const std::string name = camel(resampler.name());
    const bool hasDevices = resampler.info().isOnDevice;
    std::vector<Subject> subjects;
    if (hasDevices && kIsThreadSanitized) return subjects;
    if (hasDevices)
        for (const auto& [target, isRequired] : kDeviceTargets) {
            subjects.push_back(
                {&resampler, target, SampleFormat::r32f, subjects.empty(), isRequired, name + camel(target)});
            if (kIsAddressSanitized) break;
        }
    for (const SampleFormat format : resampler.info().formats) {
        if (hasDevices && (format == SampleFormat::r32f || kIsAddressSanitized)) continue;
        const bool isExact = format == SampleFormat::r32f;
        subjects.push_back({&resampler,
                            {},
                            format,
                            subjects.empty(),
                            hasDevices,
                            name + (isExact ? std::string() : camel(nameOf(format)))});
    }
    return subjects;
}

std::vector<Subject> subjectsOf(std::span<const Resampler* const> resamplers) {
    std::vector<Subject> all;
    for (const Resampler* resampler : resamplers) {
        if (!resampler->info().meetsContract) continue;
        const auto subjects = subjectsOf(*resampler);
        all.insert(all.end(), subjects.begin(), subjects.end());
    }
    return all;
}

namespace {

bool isOneOf(const std::string& name, std::initializer_list<const char*> names) {
    return std::find(names.begin(), names.end(), name) != names.end();
}

}  // namespace

bool takes(const Subject& subject, const LatticeCase& at) {
    if (isAnotherDevice(subject) && isHurried()) return isOneOf(at.name, {"third offset", "cut plane"});
    return (subject.isPrimary && !(subject.isOnDevice() && kIsSanitized)) ||
           isOneOf(at.name, {"aligned", "third offset", "fine", "indices about powers of two", "row along y",
                             "cut plane"});
}

bool comparesBits(const Subject& subject, const LatticeCase& at) {
    if (!takes(subject, at)) return false;
    if (!subject.isOnDevice()) return true;
    return subject.isPrimary && !kIsSanitized
               ? isOneOf(at.name, {"aligned", "fine", "far origin", "row along y", "cut plane"})
               : isOneOf(at.name, {"third offset", "cut plane"});
}

std::vector<LatticeCase> inTurn(const Subject& subject, const std::vector<LatticeCase>& cases,
                                std::size_t turn) {
    constexpr std::size_t kTurns = 3;
    if (!isHurried() || !subject.isOnDevice() || cases.size() < kTurns) return cases;
    std::vector<LatticeCase> some;
    for (std::size_t i = turn % kTurns; i < cases.size(); i += kTurns) some.push_back(cases[i]);
    return some;
}

int pointsFor(const Subject& subject, int points) {
    return subject.isPrimary ? points : (2 * points + 2) / 3;
}

std::vector<Block> sample(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                          const Lattice& lattice, std::span<const IndexBox> boxes, const Sampling& sampling) {
    std::vector<Block> blocks(boxes.size());
    std::vector<int> calls(boxes.size(), 0);
    std::mutex mutex;
    const auto bound = resampler.bind(mesh, fields, sampling.bind);
    const std::string& target = sampling.bind.target;
    EXPECT_EQ(bound->target(), target.empty() ? resampler.targets().front() : target);
    const auto take = [&](std::size_t b, const Block& block) {
        const std::lock_guard lock(mutex);
        blocks.at(b) = block;
        ++calls.at(b);
    };
    if (sampling.bind.route == Route::index) {
        // Each box by a call of its own, several at once.
        parallelFor({.threads = sampling.threads}, std::int64_t(boxes.size()), [&](std::int64_t b) {
            bound->resample(lattice, boxes.subspan(std::size_t(b), 1),
                            [&](std::size_t, const Block& block) { take(std::size_t(b), block); },
                            {.threads = 1});
        });
    } else {
        bound->resample(lattice, boxes, take, {.threads = sampling.threads});
    }
    for (const int count : calls) EXPECT_EQ(count, 1) << "every block is given out once";
    return blocks;
}

Block sample(const Subject& subject, const TetMesh& mesh, std::span<const int> fields, const Lattice& lattice,
             const IndexBox& box) {
    return std::move(
        sample(*subject.resampler, mesh, fields, lattice, std::span(&box, 1), {subject.bindOptions(), 1})[0]);
}

std::vector<IndexBox> cut(const IndexBox& box, int edge) {
    std::vector<IndexBox> boxes;
    Vec3i p;
    for (p.z = box.min.z; p.z < box.max.z; p.z += edge)
        for (p.y = box.min.y; p.y < box.max.y; p.y += edge)
            for (p.x = box.min.x; p.x < box.max.x; p.x += edge)
                boxes.push_back({p, glm::min(p + edge, box.max)});
    return boxes;
}

std::int64_t differences(const Block& part, const Block& whole) {
    std::int64_t count = 0;
    Vec3i p;
    for (p.z = part.box.min.z; p.z < part.box.max.z; ++p.z)
        for (p.y = part.box.min.y; p.y < part.box.max.y; ++p.y)
            for (p.x = part.box.min.x; p.x < part.box.max.x; ++p.x) {
                bool isSame = part.covered(p) == whole.covered(p);
                for (int c = 0; isSame && part.covered(p) && c < part.channels; ++c) {
                    const float a = part.value(c, p), b = whole.value(c, p);
                    isSame = std::memcmp(&a, &b, sizeof a) == 0;
                }
                count += !isSame;
            }
    return count;
}

namespace {

std::string describe(const LatticeCase& at) {
    const auto text = [](const Vec3d& v) {
        char buffer[100];
        std::snprintf(buffer, sizeof buffer, " (%.17g %.17g %.17g)", v.x, v.y, v.z);
        return std::string(buffer);
    };
    return "lattice: " + at.name + ", origin" + text(at.lattice.originWorld) + ", axes" +
           text(at.lattice.uWorld) + text(at.lattice.vWorld) + text(at.lattice.wWorld) + ", box" +
           text(Vec3d(at.box.min)) + text(Vec3d(at.box.max));
}

}  // namespace

Measure::Measure(const TetMesh& mesh, const LatticeCase& at, const Execution& execution)
    : at_(at), execution_(execution), oracle_(mesh, at.lattice), fields_(everyField(mesh)) {}

ContractReport Measure::operator()(const Subject& subject, const Block& block, const CheckOptions& options) {
    const ContractBounds bounds = subject.bounds();
    auto reference = std::find_if(references_.begin(), references_.end(), [&](const ReferenceBlock& r) {
        return r.toleranceVoxels == bounds.spillVoxels;
    });
    if (reference == references_.end())
        reference = references_.insert(
            reference, referenceBlock(oracle_, at_.box, {.toleranceVoxels = bounds.spillVoxels}, execution_));
    return checkContract(block, *reference, oracle_, fields_, bounds, options);
}

ContractReport measureContract(const Subject& subject, const TetMesh& mesh, const LatticeCase& at,
                               const CheckOptions& options) {
    const Block block = sample(subject, mesh, everyField(mesh), at.lattice, at.box);
    return Measure(mesh, at)(subject, block, options);
}

ContractReport expectContract(const Subject& subject, const TetMesh& mesh, const LatticeCase& at,
                              const CheckOptions& options) {
    const ContractReport report = measureContract(subject, mesh, at, options);
    EXPECT_TRUE(report.isClean()) << subject.name << ", " << describe(at) << "\n  " << report.summary();
    return report;
}

namespace {

/// A value for the elements added.
double companyValue(const Field& field, int component, SampleFormat format) {
    // In r32f a value doesn't depend on the field's range; the other formats keep the range they have.
    if (format == SampleFormat::r32f) return 1;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = std::size_t(component); i < field.values.size(); i += std::size_t(field.components))
        if (std::isfinite(float(field.values[i]))) least = std::min(least, field.values[i]);
    return least;
}

/// The mesh with elements added far from the box that `at` looks at.
TetMesh withCompany(const TetMesh& mesh, const LatticeCase& at, SampleFormat format) {
    TetMesh larger{mesh.points, mesh.tets, {}};
    const Vec3d corner = at.lattice.worldFromIndex(Vec3d(at.box.max));
    const double size = glm::length(corner - at.lattice.worldFromIndex(Vec3d(at.box.min)));
    const double away = 3 * (size + glm::length(mesh.boundsWorld().size()));
    TetMesh company = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
    place(company, {size, corner + away, false});
    appendMesh(larger, company);
    larger.fields = mesh.fields;
    for (Field& field : larger.fields) {
        std::vector<double> filler;
        for (int c = 0; c < field.components; ++c) filler.push_back(companyValue(field, c, format));
        const std::int64_t items =
            field.location == FieldLocation::point ? larger.nodeCount() : larger.elementCount();
        while (field.values.size() < std::size_t(items * field.components))
            field.values.insert(field.values.end(), filler.begin(), filler.end());
    }
    return larger;
}

}  // namespace

std::vector<std::string> findChangedBits(const Subject& subject, const TetMesh& mesh, const LatticeCase& at) {
    const Resampler& resampler = *subject.resampler;
    const std::vector<int> fields = everyField(mesh);
    const std::span one(&at.box, 1);
    const Block whole = sample(subject, mesh, fields, at.lattice, at.box);
    std::vector<std::string> changed;
    const auto compare = [&](const TetMesh& of, std::span<const IndexBox> boxes, int threads,
                             const std::string& target, const std::string& what, Route route,
                             Primitives primitives = Primitives::device) {
        BindOptions bind = subject.bindOptions();
        bind.route = route;
        bind.primitives = primitives;
        if (!target.empty()) bind.target = target;
        std::int64_t count = 0;
        for (const Block& part : sample(resampler, of, fields, at.lattice, boxes, {bind, threads}))
            count += differences(part, whole);
        if (count > 0) changed.push_back(what + ": " + std::to_string(count) + " points differ");
    };
    compare(mesh, one, 1, {}, "another run, by the index", Route::index);
    const bool isThorough = !subject.isOnDevice() || (subject.isPrimary && !kIsSanitized && !isHurried());
    for (const int threads : isThorough ? std::vector{2, 5, 16} : std::vector{3})
        compare(mesh, one, threads, {}, std::to_string(threads) + " threads, primitives by the processor",
                Route::pass, Primitives::processor);
    for (const int edge : isThorough ? std::vector{8, 16, 32, 64} : std::vector{16})
        compare(mesh, cut(at.box, edge), 3, {}, "boxes of " + std::to_string(edge),
                edge == 16 ? Route::index : Route::pass);
    if (resampler.info().targetsAgree)
        for (const std::string& target : resampler.targets())
            compare(mesh, cut(at.box, 19), 2, target, "target " + target, Route::pass);

    std::vector<IndexBox> overlapping = cut(at.box, isThorough ? 9 : 13);
    for (IndexBox& box : overlapping) box = intersect({box.min - 3, box.max + 2}, at.box);
    compare(mesh, overlapping, 2, {}, "overlapping boxes, by the index", Route::index);
    compare(withCompany(mesh, at, subject.format), one, 1, {}, "more elements elsewhere",
            isThorough ? Route::index : Route::pass);
    return changed;
}

void expectDeterministic(const Subject& subject, const TetMesh& mesh, const LatticeCase& at) {
    for (const std::string& changed : findChangedBits(subject, mesh, at))
        ADD_FAILURE() << subject.name << ", " << changed << ", " << describe(at);
}

}  // namespace tessera::contract
