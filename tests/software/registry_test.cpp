#include "tessera/registry.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>

#include "gl/gl_platform.h"
#include "registry/cost_model.h"
#include "registry/kept_costs.h"
#include "registry/measure_cost.h"
#include "tessera/error.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// A resampler that samples nothing, or fails.
class FakeResampler : public Resampler {
  public:
    struct Traits {
        std::string name{};
        std::string missing{};  // why it can't run
        std::string failure{};  // why its device is lost whenever it samples
        std::vector<SampleFormat> formats{SampleFormat::r32f};
        std::vector<std::string> targets{"default"};
        bool targetsAgree = true, meetsContract = true;
        double placeBound = 0x1p-8;
    };
    explicit FakeResampler(const Traits& traits)
        : Resampler({.name = traits.name,
                     .description = "for tests",
                     .isOnDevice = !traits.targetsAgree,
                     .targetsAgree = traits.targetsAgree,
                     .meetsContract = traits.meetsContract,
                     .formats = traits.formats,
                     .spillBoundVoxels = 0x1p-8,
                     .placeBoundVoxels = traits.placeBound}),
          traits_(traits) {}
    std::string unavailableReason() const override { return traits_.missing; }
    std::vector<std::string> targets() const override { return traits_.targets; }
    std::unique_ptr<BoundResampler> bind(const TetMesh&, std::span<const int>,
                                         const BindOptions&) const override {
        ++timesBound;
        return std::make_unique<Bound>(traits_.failure);
    }
    mutable int timesBound = 0;

  private:
    struct Bound : BoundResampler {
        explicit Bound(const std::string& failure) : failure_(failure) {}
        ResampleStatistics resample(const Lattice&, std::span<const IndexBox>, const BlockSink&,
                                    const Execution&) override {
            if (!failure_.empty()) throw GlError(failure_);
            return {};
        }
        std::string failure_;
    };
    Traits traits_;
};

const FakeResampler plain({.name = "plain"});
const FakeResampler slow({.name = "slow"});
const FakeResampler quick({.name = "quick",
                           .formats = {SampleFormat::r32f, SampleFormat::r8},
                           .targets = {"egl-device", "osmesa"},
                           .targetsAgree = false});
const FakeResampler absent({.name = "absent", .missing = "no device of that kind"});
const FakeResampler published({.name = "published", .meetsContract = false});
const FakeResampler rough({.name = "rough", .placeBound = 0.25});
const FakeResampler lost({.name = "lost", .failure = "the device was lost", .targetsAgree = false});

/// A cache of its own, and what the fakes cost in it.
class Registry : public testing::Test {
  protected:
    Registry() {
        fs::create_directories(folder_);
        ::setenv("XDG_CACHE_HOME", folder_.c_str(), 1);
        keep(plain, {10, 0, 1e-6, 0});
        keep(slow, {0, 1e-4, 1e-5, 0});
        for (const char* target : {"", "osmesa"}) keep(quick, {1, 0, 1e-6, 0}, target);
    }
    ~Registry() override { fs::remove_all(folder_); }

    static void keep(const Resampler& resampler, const CostModel& cost, const std::string& target = {}) {
        BindOptions options;
        options.target = target;
        keepCosts(costsPath(), {{costKey(resampler, options, {}), cost}});
    }

    const fs::path folder_ = fs::path(testing::TempDir()) / ("registry_test_" + std::to_string(::getpid()));
};

ResamplerChoice choose(std::vector<const Resampler*> candidates, std::string_view name,
                       const BindOptions& options = {}) {
    return chooseResampler(candidates, name, options);
}

std::string rejection(const std::vector<const Resampler*>& candidates, std::string_view name,
                      const BindOptions& options = {}) {
    try {
        choose(candidates, name, options);
    } catch (const InputError& error) {
        return error.what();
    }
    ADD_FAILURE() << "accepted " << name;
    return {};
}

bool holds(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

TEST_F(Registry, NamesAreUniqueAndFoundAgain) {
    for (const Resampler* resampler : resamplers()) {
        EXPECT_EQ(&namedResampler(resampler->name()), resampler);
        EXPECT_EQ(std::count_if(resamplers().begin(), resamplers().end(),
                                [&](const Resampler* other) { return other->name() == resampler->name(); }),
                  1);
        EXPECT_NE(resampler->name(), "auto");
    }
    EXPECT_THROW(namedResampler("magic"), InputError);
    EXPECT_THROW(findResampler("magic"), InputError);
}

TEST_F(Registry, SoftwareIsThere) {
    EXPECT_EQ(chooseResampler("software").resampler, &findResampler("software"));
    EXPECT_TRUE(chooseResampler("software").reason.empty());
}

TEST_F(Registry, AutoTakesTheQuickestThatCanRunAndIsExactEnough) {
    const ResamplerChoice choice = choose({&plain, &slow, &quick, &absent, &rough}, "auto");
    EXPECT_EQ(choice.resampler, &quick);
    EXPECT_EQ(
        choice.reason,
        "auto chose quick: about 0.018 s for 1 million elements and 16.8 million points; plain about "
        "0.027 s, slow about 0.27 s; absent can't run here (no device of that kind); rough is not exact "
        "enough");
    EXPECT_EQ(choice.others, (std::vector<const Resampler*>{&plain, &slow}));
    EXPECT_EQ(choose({&slow, &plain}, "auto").resampler, &plain);
    EXPECT_EQ(choose({&slow, &absent}, "auto").reason,
              "auto chose slow: absent can't run here (no device of that kind)");
    EXPECT_EQ(choose({&slow}, "auto").reason, "auto chose slow, the only one there is");
}

TEST_F(Registry, AutoPredictsForTheWorkThatThereIs) {
    const std::vector<const Resampler*> both{&plain, &slow};
    EXPECT_EQ(chooseResampler(both, "auto", {}, {1000, 1000}).reason,
              "auto chose slow: less than 0.001 s for 1000 elements and 1000 points; plain about 0.01 s");
    EXPECT_EQ(chooseResampler(both, "auto", {}, {1000, 1 << 28}).resampler, &plain);
}

TEST_F(Registry, AutoMeasuresWhatIsNotKeptAndKeepsIt) {
    const FakeResampler fresh({.name = "fresh"});
    EXPECT_EQ(choose({&fresh, &lost, &slow}, "auto").resampler, &fresh);  // it takes no time
    const int bound = fresh.timesBound;
    EXPECT_GT(bound, 0);
    const ResamplerChoice again = choose({&fresh, &lost, &slow}, "auto");
    EXPECT_EQ(again.resampler, &fresh);
    EXPECT_EQ(fresh.timesBound, bound);
    EXPECT_TRUE(holds(again.reason, "lost failed when it was measured (the device was lost)"))
        << again.reason;
    EXPECT_EQ(slow.timesBound, 0);
}

TEST_F(Registry, AutoNeedsNoCache) {
    const FakeResampler fresh({.name = "fresh"});
    for (const char* folder : {"/dev/null/nowhere", ""}) {
        ::setenv("XDG_CACHE_HOME", folder, 1);
        const std::string home = std::getenv("HOME") ? std::getenv("HOME") : "";
        ::unsetenv("HOME");
        EXPECT_NE(choose({&fresh, &rough, &slow}, "auto").resampler, nullptr);
        EXPECT_EQ(costsPath().empty(), *folder == 0);
        if (!home.empty()) ::setenv("HOME", home.c_str(), 1);
    }
}

TEST_F(Registry, ABrokenCacheHoldsNothing) {
    const std::string path = costsPath();
    EXPECT_EQ(path, (folder_ / "tessera" / "algorithm_times.json").string());
    const std::string entry = R"({"fixed_ms": 1, "element_ms": 0, "point_ms": 0, "slice_ms": 0})";
    for (const std::string& text :
         {std::string(), std::string("{"), std::string("[1, 2]"), std::string(R"({"a": 3})"),
          std::string(R"({"a": {"fixed_ms": 1}})"), std::string(1 << 20, ' '),
          std::string(R"({"a": {"fixed_ms": -1, "element_ms": 0, "point_ms": 0, "slice_ms": 0}})"),
          std::string(R"({"a": {"fixed_ms": 1e300, "element_ms": 0, "point_ms": 0, "slice_ms": 0}})"),
          std::string(R"({"a": {"fixed_ms": 0, "element_ms": 0, "point_ms": 0, "slice_ms": 0}})"),
          std::string(R"({"a": {"fixed_ms": "1", "element_ms": 0, "point_ms": 0, "slice_ms": 0}})")}) {
        std::ofstream(path) << text;
        EXPECT_TRUE(readCosts(path).empty()) << text.substr(0, 80);
        keepCosts(path, {{"b", {1, 2, 3, 4}}});
        EXPECT_EQ(readCosts(path), (KeptCosts{{"b", {1, 2, 3, 4}}})) << text.substr(0, 80);
    }
    std::ofstream(path) << R"({"a": )" << entry << R"(, "b": )" << entry << "}";
    keepCosts(path, {{"b", {0, 2, 3, 4}}});
    EXPECT_EQ(readCosts(path), (KeptCosts{{"a", {1, 0, 0, 0}}, {"b", {0, 2, 3, 4}}}));
    fs::remove(path);
    fs::create_directory(path);
    EXPECT_TRUE(readCosts(path).empty());
    keepCosts(path, {{"b", {1, 2, 3, 4}}});
}

TEST_F(Registry, ACostHoldsForOneTargetFormatAndNumberOfThreads) {
    Execution one, two;
    one.threads = 1;
    two.threads = 2;
    BindOptions osmesa, coarse;
    osmesa.target = "osmesa";
    coarse.format = SampleFormat::r8;
    const std::string key = costKey(quick, {}, one);
    EXPECT_EQ(key, costKey(quick, {}, one));
    EXPECT_NE(key, costKey(quick, {}, two));
    EXPECT_NE(key, costKey(quick, osmesa, one));
    EXPECT_NE(key, costKey(quick, coarse, one));
    EXPECT_NE(key, costKey(plain, {}, one));
    const Resampler& slicing = namedResampler("slicing");
    if (slicing.unavailableReason().empty()) {
        EXPECT_TRUE(holds(costKey(slicing, {}, one), glDriver(parseGlPlatform(slicing.targets().front()))));
    }
}

TEST(CostModel, TheFitFindsWhatTimesWereMadeOf) {
    const CostModel truth{0.5, 2e-4, 3e-6, 1e-5};
    std::vector<TimedWork> timed;
    for (const std::int64_t elements : {750, 10368})
        for (const std::int64_t points : {8000, 64000})
            timed.push_back({{elements, points}, truth.ms({elements, points})});
    const WorkSize large{1'000'000, 16'777'216};
    EXPECT_NEAR(fitCost(timed).ms(large) / truth.ms(large), 1, 0.02);
    EXPECT_NEAR(truth.ms({1000, 8000}), 0.5 + 0.2 + 0.024 + 0.02, 1e-12);
    EXPECT_TRUE(fitCost(timed).isSane());
}

TEST(CostModel, NoTimesMakeANegativeCost) {
    // The more there is to do the less time it takes.
    const std::vector<TimedWork> timed{
        {{750, 8000}, 4}, {{10368, 8000}, 3}, {{750, 64000}, 2}, {{10368, 64000}, 1}};
    const CostModel cost = fitCost(timed);
    EXPECT_TRUE(cost.isSane());
    EXPECT_GE(cost.ms({1, 1}), 0);
}

TEST(CostModel, MeasuringSoftwareGivesASaneCost) {
    EXPECT_TRUE(measureCost(findResampler("software"), {}, 0, {}).isSane());
}

TEST_F(Registry, AutoHeedsTheOptions) {
    BindOptions options;
    options.format = SampleFormat::r8;
    EXPECT_EQ(choose({&plain, &quick}, "auto", options).resampler, &quick);
    const std::string none = rejection({&plain, &absent}, "auto", options);
    EXPECT_TRUE(holds(none, "plain samples in r32f only")) << none;
    EXPECT_TRUE(holds(none, "no device of that kind")) << none;
    options = {};
    options.target = "osmesa";
    EXPECT_EQ(choose({&plain, &quick}, "auto", options).resampler, &quick);
}

TEST_F(Registry, AutoTakesNoMethodAsItWasPublished) {
    EXPECT_EQ(choose({&published, &plain, &slow}, "auto").resampler, &plain);
    EXPECT_TRUE(holds(rejection({&published}, "auto"), "as it was published"));
    EXPECT_EQ(choose({&published, &plain}, "published").resampler, &published);
    for (const char* name : {"slicing-2001", "hybrid-2001"})
        EXPECT_FALSE(namedResampler(name).info().meetsContract);
}

TEST_F(Registry, ANamedOneMustRunAndHaveTheOptions) {
    EXPECT_EQ(choose({&plain, &quick}, "plain").resampler, &plain);
    EXPECT_EQ(choose({&plain, &rough}, "rough").resampler, &rough);
    EXPECT_TRUE(holds(rejection({&plain, &absent}, "absent"), "no device of that kind"));
    EXPECT_TRUE(holds(rejection({&plain, &absent}, "magic"), "plain, absent"));
    BindOptions options;
    options.format = SampleFormat::r16f;
    EXPECT_TRUE(holds(rejection({&plain, &quick}, "quick", options), "r32f, r8"));
    options = {};
    options.target = "osmesa";
    EXPECT_TRUE(holds(rejection({&plain, &quick}, "plain", options), "osmesa"));
    // A device that is missing is for the resampler to explain.
    options.target = "egl-surfaceless";
    EXPECT_EQ(choose({&plain, &quick}, "quick", options).resampler, &quick);
}

TEST_F(Registry, AutoGoesOnWithoutADeviceThatFailed) {
    const std::optional<ResamplerChoice> other =
        chooseInstead(choose({&slow, &plain, &quick}, "auto"), "lost");
    ASSERT_TRUE(other);
    EXPECT_FALSE(other->resampler->info().isOnDevice);
    EXPECT_EQ(other->resampler, &plain);
    EXPECT_EQ(other->reason, "quick failed here (lost), so auto goes on with plain");
    // Neither a failure that no device is to blame for nor one of an algorithm that was asked for by name.
    EXPECT_FALSE(chooseInstead(choose({&plain, &slow}, "auto"), "lost"));
    EXPECT_FALSE(chooseInstead(choose({&plain, &quick}, "quick"), "lost"));
    BindOptions options;
    options.format = SampleFormat::r8;
    EXPECT_FALSE(chooseInstead(choose({&plain, &quick}, "auto", options), "lost"));
}

TEST_F(Registry, TakesAnAlgorithmOfTheCallersOwn) {
    registerResampler(std::make_unique<FakeResampler>(FakeResampler::Traits{.name = "own"}));
    EXPECT_EQ(findResampler("own").name(), "own");
    keep(findResampler("own"), {1e-9, 0, 0, 0});
    EXPECT_EQ(chooseResampler("auto").resampler->name(), "own");
    for (const char* taken : {"own", "software", "auto"})
        EXPECT_THROW(registerResampler(std::make_unique<FakeResampler>(FakeResampler::Traits{.name = taken})),
                     InputError);
}

}  // namespace
}  // namespace tessera
