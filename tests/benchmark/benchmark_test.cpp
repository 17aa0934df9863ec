#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <thread>

#include "benchmark/analyse_runs.h"
#include "benchmark/compare_benchmarks.h"
#include "benchmark/median_interval.h"
#include "benchmark/oracle_errors.h"
#include "benchmark/timed_cases.h"
#include "reference/generators.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

std::vector<double> upTo(int n) {
    std::vector<double> values;
    for (int i = n; i >= 1; --i) values.push_back(i);
    return values;
}

// Ranks from tables of the sign test's intervals.
TEST(MedianInterval, TakesTheRanksThatHoldTheMedianInNineteenOfTwenty) {
    struct Row {
        int n, low, high;
        double median;
    };
    for (const Row& row : {Row{1, 1, 1, 1}, Row{5, 1, 5, 3}, Row{6, 1, 6, 3.5}, Row{8, 1, 8, 4.5},
                           Row{9, 2, 8, 5}, Row{10, 2, 9, 5.5}, Row{12, 3, 10, 6.5}, Row{20, 6, 15, 10.5}}) {
        const MedianInterval interval = medianInterval(upTo(row.n));
        EXPECT_EQ(interval.low, row.low) << row.n;
        EXPECT_EQ(interval.high, row.high) << row.n;
        EXPECT_EQ(interval.median, row.median) << row.n;
        EXPECT_EQ(interval.count, std::size_t(row.n));
    }
}

TEST(PowerFit, FindsTheExponentAndItsInterval) {
    const PowerFit exact =
        fitPower({1, 10, 100, 1000}, {3, 3 * std::pow(10, 1.5), 3e3, 3 * std::pow(10, 4.5)});
    EXPECT_NEAR(exact.exponent, 1.5, 1e-12);
    EXPECT_NEAR(exact.factor, 3, 1e-12);
    EXPECT_NEAR(exact.high - exact.low, 0, 1e-12);
    // By hand: logarithms 0, 1, 2 against 0, 1.3, 2: slope 1, rests -0.1, 0.2, -0.1, error sqrt(0.06 / 2).
    const PowerFit fit = fitPower({1, std::exp(1), std::exp(2)}, {1, std::exp(1.3), std::exp(2)});
    EXPECT_NEAR(fit.exponent, 1, 1e-12);
    EXPECT_NEAR(fit.high - 1, 12.71 * std::sqrt(0.03), 1e-9);
    EXPECT_TRUE(std::isinf(fitPower({1, 2}, {1, 2}).high));
}

Json timeJson(double ms) {
    return intervalJson({ms, ms * 0.9, ms * 1.1, 9});
}

Json runJson(const std::string& variant, const std::string& criterion, double resolution, double ms,
             double error) {
    return {{"variant", variant},
            {"criterion", criterion},
            {"asked", "x"},
            {"resolution", resolution},
            {"bound", nullptr},
            {"voxels", resolution * resolution * resolution},
            {"covered", 1000},
            {"ms", timeJson(ms)},
            {"error", {{"max", error}, {"rms", error / 10}}}};
}

const Json& entryOf(const Json& all, const char* measure, double bound) {
    for (const Json& entry : all)
        if (entry["measure"] == measure && entry["bound"] == bound) return entry;
    static const Json none;
    return none;
}

TEST(EqualError, LiesBetweenTheLatticesOnEitherSideOfTheBound) {
    // Error 1 / r^2 and time r^3, so r^3 at an error of e is e^-1.5, whichever lattices are there.
    Json runs = Json::array();
    for (const double r : {2.0, 4.0, 8.0}) runs.push_back(runJson("a", "uniform", r, r * r * r, 1 / (r * r)));
    const Json all = equalErrorJson(runs);
    for (const double bound : {0.1, 0.05, 0.02}) {
        const Json& entry = entryOf(all, "max", bound);
        EXPECT_EQ(entry["how"], "between two resolutions");
        EXPECT_NEAR(entry["ms"]["median"].get<double>(), std::pow(bound, -1.5), 1e-9);
        EXPECT_NEAR(entry["ms"]["low"].get<double>(), 0.9 * std::pow(bound, -1.5), 1e-9);
        EXPECT_NEAR(entry["resolution"].get<double>(), std::pow(bound, -0.5), 1e-9);
    }
    EXPECT_EQ(entryOf(all, "max", 0.01)["how"], "not reached");
    EXPECT_TRUE(entryOf(all, "max", 0.01)["ms"].is_null());
    EXPECT_EQ(entryOf(all, "rms", 0.1)["how"], "coarsest tried");
}

TEST(EqualError, TakesRefinementByTheLargestErrorForNothingElse) {
    Json runs = Json::array();
    for (const double bound : {0.1, 0.05, 0.02, 0.01}) {
        Json run = runJson("a", "error", 0, 1 / bound, 0.9 * bound);
        run["bound"] = bound;
        run["voxels"] = 100 / bound;
        run["resolution"] = nullptr;
        runs.push_back(run);
    }
    const Json all = equalErrorJson(runs);
    for (const double bound : {0.1, 0.05, 0.02, 0.01})
        EXPECT_EQ(entryOf(all, "max", bound)["ms"]["median"], 1 / bound);
    // The RMS of each is a tenth: the first one is close enough for all but the last.
    EXPECT_EQ(entryOf(all, "rms", 0.02)["ms"]["median"], 10);
    EXPECT_EQ(entryOf(all, "rms", 0.01)["how"], "coarsest tried");
    runs.erase(2);
    runs.erase(2);
    EXPECT_EQ(entryOf(equalErrorJson(runs), "max", 0.01)["how"], "not tried");
}

TEST(EqualError, DoesNotTrustALatticeWithALargerErrorBehindIt) {
    Json runs = Json::array();
    runs.push_back(runJson("a", "uniform", 2, 1, 0.3));
    runs.push_back(runJson("a", "uniform", 4, 2, 0.04));
    runs.push_back(runJson("a", "uniform", 8, 4, 0.2));
    runs.push_back(runJson("a", "uniform", 16, 8, 0.05));
    const Json all = equalErrorJson(runs);
    const double resolution = entryOf(all, "max", 0.1)["resolution"].get<double>();
    EXPECT_GT(resolution, 8);
    EXPECT_LT(resolution, 16);
}

TEST(Pareto, KeepsWhatNothingElseBeats) {
    Json runs = Json::array();
    runs.push_back(runJson("a", "uniform", 2, 1, 0.5));
    runs.push_back(runJson("b", "uniform", 2, 2, 0.6));  // slower and further
    runs.push_back(runJson("b", "uniform", 4, 3, 0.4));
    runs.push_back(runJson("a", "uniform", 4, 4, 0.3999));  // the same error, as far as it matters
    runs.push_back(runJson("a again", "uniform", 4, 0.1, 0.01));
    const Json variants{{{"name", "a"}, {"role", "main"}},
                        {{"name", "b"}, {"role", "peer"}},
                        {{"name", "a again"}, {"role", "again"}}};
    EXPECT_EQ(paretoJson(runs, variants)["max"], Json({0, 2}));
}

// What a run of a build that takes `factor` times as long might report on a machine of some noise.
Json documentOf(double factorOfA, double machine, unsigned seed, double factorOfDevice = 1) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 0.03);
    const auto ms = [&](double value) { return timeJson(value * machine * std::exp(noise(random))); };
    Json runs = Json::array(), warm = Json::array(), variants = Json::array();
    // Each algorithm has better and worse minutes of its own.
    std::normal_distribution<double> minute(0, 0.025);
    for (const std::string variant : {"a", "b", "c", "d", "e", "f", "g"}) {
        const double factor = variant == "a" ? factorOfA : variant < "f" ? factorOfDevice : 1;
        const double own = factor * std::exp(minute(random));
        // One on the processor, two peers, four that share the code of a device.
        const bool isPeer = variant == "f" || variant == "g";
        variants.push_back({{"name", variant},
                            {"algorithm", variant},
                            {"role", isPeer ? "peer" : "main"},
                            {"primitives", variant == "a" || isPeer ? Json(nullptr) : Json("device")}});
        for (int i = 1; i <= 10; ++i) {
            Json run = runJson(variant, "uniform", i, 1, 0.1);
            run["asked"] = std::to_string(i);
            run["ms"] = ms(i * own);
            runs.push_back(run);
        }
    }
    return {{"command", "bench"},
            {"input", {{"mesh", "m"}, {"elements", 5}, {"field", "f"}}},
            {"machine",
             {{"threads", 2}, {"processor", "p"}, {"opengl", nullptr}, {"commit", "c"}, {"date", "d"}}},
            {"variants", variants},
            {"runs", runs},
            {"scaling", {{"elements", Json::array()}}},
            {"warm", warm},
            {"yardstick", ms(20)}};
}

TEST(CompareBenchmarks, NamesTheAlgorithmThatGotSlower) {
    const Json compared = compareBenchmarks(documentOf(1, 1, 1), documentOf(1.2, 1, 2));
    ASSERT_EQ(compared["sentences"].size(), 1u) << compared.dump(1);
    EXPECT_EQ(compared["sentences"][0].get<std::string>().rfind("a got slower", 0), 0u);
    EXPECT_EQ(compared["algorithms"][1]["verdict"], "equal");  // b
    const Json faster = compareBenchmarks(documentOf(1, 1, 1), documentOf(0.8, 1, 2));
    EXPECT_EQ(faster["sentences"][0].get<std::string>().rfind("a got faster", 0), 0u);
}

TEST(CompareBenchmarks, IsNotOutvotedByAlgorithmsThatShareTheirCode) {
    const Json compared = compareBenchmarks(documentOf(1, 1, 1), documentOf(1, 1, 2, 1.3));
    ASSERT_EQ(compared["sentences"].size(), 4u) << compared["sentences"].dump(1);
    for (const Json& row : compared["algorithms"])
        EXPECT_EQ(row["verdict"], row["algorithm"] == "a"   ? "equal"
                                  : row["algorithm"] >= "f" ? "not judged"
                                                            : "slower")
            << row.dump();
}

TEST(CompareBenchmarks, TakesABusyMachineForWhatItIs) {
    const Json compared = compareBenchmarks(documentOf(1, 1, 1), documentOf(1, 1.5, 2));
    for (const Json& row : compared["algorithms"]) EXPECT_NE(row["verdict"], "slower") << row.dump();
    EXPECT_NEAR(compared["yardstick"].get<double>(), 1.5, 0.2);
}

TEST(CompareBenchmarks, SaysWhenEverythingGotSlower) {
    Json later = documentOf(1, 1.5, 2);
    later["yardstick"] = timeJson(20);
    const Json compared = compareBenchmarks(documentOf(1, 1, 1), later);
    ASSERT_EQ(compared["sentences"].size(), 2u);
    EXPECT_NE(compared["sentences"][1].get<std::string>().find("the whole build changed"), std::string::npos);
}

TEST(CompareBenchmarks, RaisesNoAlarmBetweenEqualBuilds) {
    int alarms = 0;
    for (unsigned seed = 0; seed < 200; ++seed) {
        const Json compared = compareBenchmarks(documentOf(1, 1, 2 * seed), documentOf(1, 1, 2 * seed + 1));
        for (const Json& row : compared["algorithms"])
            alarms += row["verdict"] == "slower" || row["verdict"] == "faster";
    }
    EXPECT_LE(alarms, 10);  // of 1,000
}

TEST(CompareBenchmarks, RefusesAnotherMeshOrAnotherNumberOfThreads) {
    Json other = documentOf(1, 1, 1);
    other["input"]["field"] = "g";
    EXPECT_THROW(compareBenchmarks(other, documentOf(1, 1, 1)), InputError);
    other = documentOf(1, 1, 1);
    other["machine"]["threads"] = 3;
    EXPECT_THROW(compareBenchmarks(other, documentOf(1, 1, 1)), InputError);
}

TEST(Rounds, RunEveryCaseOnceInEachInChangingOrder) {
    std::vector<std::string> order;
    std::vector<TimedCase> cases(4);
    for (std::size_t i = 0; i < cases.size(); ++i) {
        cases[i].what = std::string(1, char('a' + i));
        cases[i].run = [&order, name = cases[i].what](const Execution&) {
            order.push_back(name);
            CaseSample sample;
            sample.ms = sample.wallMs = 100;  // as it says: too long to be repeated
            return sample;
        };
    }
    const int rounds = runRounds(cases, {.rounds = 8, .seed = 3}, {}, [](const std::string&) {});
    EXPECT_EQ(rounds, 8);
    ASSERT_EQ(order.size(), 4u * 9);  // one before the rounds
    std::set<std::vector<std::string>> orders;
    for (std::size_t at = 4; at < order.size(); at += 4) {
        std::vector<std::string> round(order.begin() + std::ptrdiff_t(at),
                                       order.begin() + std::ptrdiff_t(at) + 4);
        orders.insert(round);
        std::sort(round.begin(), round.end());
        EXPECT_EQ(round, (std::vector<std::string>{"a", "b", "c", "d"}));
    }
    EXPECT_GT(orders.size(), 3u);
    for (const TimedCase& one : cases) EXPECT_EQ(one.samples.size(), 8u);
}

TEST(Rounds, LeaveOutWhatFailsAndWhatTakesTooLong) {
    std::vector<TimedCase> cases(4);
    const auto taking = [](double ms) {
        return [ms](const Execution&) {
            CaseSample sample;
            sample.ms = sample.wallMs = ms;
            return sample;
        };
    };
    for (std::size_t i = 0; i < 3; ++i) {
        cases[i].what = "case " + std::to_string(i);
        cases[i].ladder = "ladder";
        cases[i].work = std::pow(100, double(i));
    }
    cases[0].run = taking(50);
    cases[1].run =
        cases[2].run = [](const Execution&) -> CaseSample { throw std::logic_error("not reached"); };
    cases[3].what = "broken";
    cases[3].run = [](const Execution&) -> CaseSample { throw InputError("no such thing"); };
    runRounds(cases, {.rounds = 2, .longestRunMs = 1000}, {}, [](const std::string&) {});
    EXPECT_TRUE(cases[0].isTimed());
    EXPECT_EQ(cases[1].leftOut, "case 1: a run would take about 1.6 s");
    EXPECT_FALSE(cases[1].isFollower);
    EXPECT_EQ(cases[2].leftOut, "case 2: left out as the one before it");
    EXPECT_TRUE(cases[2].isFollower);
    EXPECT_EQ(cases[3].leftOut, "broken: no such thing");
}

TEST(Rounds, EndAFirstRunThatTakesFarTooLong) {
    std::vector<TimedCase> cases(1);
    cases[0].what = "endless";
    cases[0].run = [](const Execution& execution) -> CaseSample {
        for (;;) {
            execution.throwIfCancelled();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    };
    runRounds(cases, {.rounds = 1, .longestRunMs = 50}, {}, [](const std::string&) {});
    EXPECT_EQ(cases[0].leftOut, "endless: a run takes more than 0.15 s");
}

/// Samples the field half a voxel off, and covers nothing in the upper half.
class Shifted : public Resampler {
  public:
    Shifted() : Resampler({.name = "shifted", .description = ""}) {}
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions&) const override {
        class Bound : public BoundResampler {
          public:
            explicit Bound(std::unique_ptr<BoundResampler> inner) : inner_(std::move(inner)) {}
            ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                        const BlockSink& sink, const Execution& execution) override {
                return inner_->resample(
                    lattice, boxes,
                    [&](std::size_t at, const Block& block) {
                        Block changed = block;
                        for (float& value : changed.values) value += 0.25f;
                        const Vec3i n = block.box.size();
                        for (std::size_t i = 0; i < changed.coverage.size(); ++i)
                            if (lattice
                                    .worldFromIndex(Vec3d(block.box.min) +
                                                    Vec3d(0, 0, double(i / std::size_t(n.x * n.y))))
                                    .z > 0.5)
                                changed.coverage[i] = 0;
                        sink(at, changed);
                    },
                    execution);
            }

          private:
            std::unique_ptr<BoundResampler> inner_;
        };
        return std::make_unique<Bound>(findResampler("software").bind(mesh, fields));
    }
};

TEST(OraclePlaces, MeasureErrorsAndHoles) {
    TetMesh mesh = boxMesh({.cells = Vec3i(3), .jitter = 0.2});
    Field field{"f", FieldLocation::point, 1, {}};
    for (const Vec3d& p : mesh.points) field.values.push_back(p.x);
    mesh.fields = {field};
    const OraclePlaces places(mesh, 0, {.places = 100, .lattices = 2}, {});
    EXPECT_EQ(places.count(), 100u);
    const OracleFigures right = places.measure(findResampler("software"), {}, {});
    EXPECT_EQ(right.error.count, 100);
    EXPECT_LT(right.error.max, 1e-6);
    EXPECT_EQ(right.holes + right.spills, 0);
    const OracleFigures shifted = places.measure(Shifted(), {}, {});
    EXPECT_NEAR(shifted.error.max, 0.25, 1e-6);  // the field's range is 1
    EXPECT_NEAR(shifted.error.rms, 0.25, 1e-6);
    EXPECT_LT(shifted.error.count, 80);
    EXPECT_GT(shifted.error.count, 20);
    EXPECT_GT(shifted.holes, 1000);
    const std::string csv = places.csv({"right", "shifted"}, {right, shifted});
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 101);
}

}  // namespace
}  // namespace tessera
