#include "tessera/registry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "tessera/error.h"

namespace tessera {
namespace {

/// A resampler that can only be chosen.
class FakeResampler : public Resampler {
  public:
    struct Traits {
        std::string name{};
        double cost = 1;
        std::string missing{};  // why it can't run
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
    double relativeCost() const override { return traits_.cost; }
    std::unique_ptr<BoundResampler> bind(const TetMesh&, std::span<const int>,
                                         const BindOptions&) const override {
        return nullptr;
    }

  private:
    Traits traits_;
};

const FakeResampler plain({.name = "plain"});
const FakeResampler slow({.name = "slow", .cost = 5});
const FakeResampler quick({.name = "quick",
                           .cost = 0.1,
                           .formats = {SampleFormat::r32f, SampleFormat::r8},
                           .targets = {"egl-device", "osmesa"},
                           .targetsAgree = false});
const FakeResampler absent({.name = "absent", .cost = 0.01, .missing = "no device of that kind"});
const FakeResampler published({.name = "published", .cost = 0.01, .meetsContract = false});
const FakeResampler rough({.name = "rough", .cost = 0.01, .placeBound = 0.25});

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

TEST(Registry, NamesAreUniqueAndFoundAgain) {
    for (const Resampler* resampler : resamplers()) {
        EXPECT_EQ(&namedResampler(resampler->name()), resampler);
        EXPECT_EQ(std::count_if(resamplers().begin(), resamplers().end(),
                                [&](const Resampler* other) { return other->name() == resampler->name(); }),
                  1);
        EXPECT_NE(resampler->name(), "auto");
        if (resampler->unavailableReason().empty()) {
            EXPECT_GT(resampler->relativeCost(), 0);
        }
    }
    EXPECT_THROW(namedResampler("magic"), InputError);
    EXPECT_THROW(findResampler("magic"), InputError);
}

TEST(Registry, SoftwareIsThereAndCostsOne) {
    EXPECT_EQ(chooseResampler("software").resampler, &findResampler("software"));
    EXPECT_TRUE(chooseResampler("software").reason.empty());
    EXPECT_EQ(findResampler("software").relativeCost(), 1);
}

TEST(Registry, AutoTakesTheCheapestThatCanRunAndIsExactEnough) {
    const ResamplerChoice choice = choose({&plain, &slow, &quick, &absent, &rough}, "auto");
    EXPECT_EQ(choice.resampler, &quick);
    EXPECT_TRUE(holds(choice.reason, "auto chose quick")) << choice.reason;
    EXPECT_TRUE(holds(choice.reason, "plain is slower")) << choice.reason;
    EXPECT_TRUE(holds(choice.reason, "no device of that kind")) << choice.reason;
    EXPECT_TRUE(holds(choice.reason, "rough is not exact enough")) << choice.reason;
    EXPECT_EQ(choose({&slow, &plain}, "auto").resampler, &plain);
    EXPECT_EQ(choose({&slow, &absent}, "auto").resampler, &slow);
}

TEST(Registry, AutoHeedsTheOptions) {
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

TEST(Registry, AutoTakesNoMethodAsItWasPublished) {
    EXPECT_EQ(choose({&published, &plain}, "auto").resampler, &plain);
    EXPECT_TRUE(holds(rejection({&published}, "auto"), "as it was published"));
    EXPECT_EQ(choose({&published, &plain}, "published").resampler, &published);
    for (const char* name : {"slicing-2001", "hybrid-2001"})
        EXPECT_FALSE(namedResampler(name).info().meetsContract);
}

TEST(Registry, ANamedOneMustRunAndHaveTheOptions) {
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

TEST(Registry, AutoGoesOnWithoutADeviceThatFailed) {
    const std::optional<ResamplerChoice> other = chooseInstead(choose({&plain, &quick}, "auto"), "lost", {});
    ASSERT_TRUE(other);
    EXPECT_FALSE(other->resampler->info().isOnDevice);
    EXPECT_EQ(other->reason, "quick failed here (lost), so auto goes on with " + other->resampler->name());
    // Neither a failure that no device is to blame for nor one of an algorithm that was asked for by name.
    EXPECT_FALSE(chooseInstead(choose({&plain, &slow}, "auto"), "lost", {}));
    EXPECT_FALSE(chooseInstead(choose({&plain, &quick}, "quick"), "lost", {}));
    BindOptions options;
    options.format = SampleFormat::r8;
    EXPECT_FALSE(chooseInstead(choose({&plain, &quick}, "auto", options), "lost", options));
}

TEST(Registry, TakesAnAlgorithmOfTheCallersOwn) {
    registerResampler(std::make_unique<FakeResampler>(FakeResampler::Traits{.name = "own", .cost = 1e-6}));
    EXPECT_EQ(findResampler("own").name(), "own");
    EXPECT_EQ(chooseResampler("auto").resampler->name(), "own");
    for (const char* taken : {"own", "software", "auto"})
        EXPECT_THROW(registerResampler(std::make_unique<FakeResampler>(FakeResampler::Traits{.name = taken})),
                     InputError);
}

}  // namespace
}  // namespace tessera
