#include "benchmark/run_benchmark.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include "base/timer.h"
#include "benchmark/analyse_runs.h"
#include "benchmark/benchmark_page.h"
#include "benchmark/benchmark_text.h"
#include "benchmark/benchmark_variants.h"
#include "benchmark/brick_cases.h"
#include "benchmark/compare_benchmarks.h"
#include "benchmark/graded_box.h"
#include "benchmark/machine_rates.h"
#include "benchmark/machine_text.h"
#include "benchmark/oracle_errors.h"
#include "benchmark/paper_cases.h"
#include "benchmark/picture_errors.h"
#include "benchmark/program_memory.h"
#include "benchmark/quoted_text.h"
#include "benchmark/warm_cases.h"
#include "files/atomic_file.h"
#include "job/field_selection.h"
#include "job/import_mesh.h"
#include "job/output_paths.h"
#include "job/report_text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kMostPageBytes = 1'000'000;

/// How much is done.
struct Extent {
    std::vector<int> resolutions, focusPoints, warmPoints, elements;
    std::vector<double> bounds, elementSamples;
    std::vector<std::array<int, 2>> bricks;  ///< edges, and elements that they hold
    int variationPoints = 0, mostRounds = 0, paperPoints = 0, elementsPoints = 0, pictureSize = 0, places = 0,
        lattices = 0;
    double seconds = 0, longestRunMs = 0, sampleMs = 0;
};

Extent extentOf(const BenchmarkRequest& request) {
    Extent extent;
    if (request.isQuick)
        extent = {.resolutions = {24, 48, 96},
                  .focusPoints = {96},
                  .warmPoints = {},
                  .elements = {2000, 8000, 32000},
                  .bounds = {0.1, 0.05},
                  .elementSamples = {1},
                  .bricks = {{16, 100}},
                  .variationPoints = 48,
                  .mostRounds = 6,
                  .paperPoints = 128,
                  .elementsPoints = 24,
                  .pictureSize = 160,
                  .places = 1000,
                  .lattices = 2,
                  .seconds = 24,
                  .longestRunMs = 300,
                  .sampleMs = 20};
    else
        extent = {.resolutions = {32, 64, 128, 256},
                  .focusPoints = {128, 256},
                  .warmPoints = {},
                  .elements = {10000, 30000, 100000, 300000},
                  .bounds = {0.1, 0.05, 0.02, 0.01},
                  .elementSamples = {1, 2},
                  .bricks = {{16, 30}, {16, 300}, {64, 10000}},
                  .variationPoints = 128,
                  .mostRounds = 9,
                  .paperPoints = 256,
                  .elementsPoints = 64,
                  .pictureSize = 384,
                  .places = 1000,
                  .lattices = 4,
                  .seconds = 300,
                  .longestRunMs = 2.5e3,
                  .sampleMs = 60};
    if (!request.resolutions.empty()) {
        extent.resolutions = request.resolutions;
        std::sort(extent.resolutions.begin(), extent.resolutions.end());
        extent.resolutions.erase(std::unique(extent.resolutions.begin(), extent.resolutions.end()),
                                 extent.resolutions.end());
        extent.variationPoints = extent.resolutions[extent.resolutions.size() / 2];
    }
    for (const int points : extent.resolutions)
        if (points >= (request.isQuick ? extent.variationPoints : 64)) extent.warmPoints.push_back(points);
    if (request.isQuick) extent.warmPoints.resize(1);
    if (request.rounds) extent.mostRounds = *request.rounds;
    if (request.seconds) extent.seconds = *request.seconds;
    if (request.longestSeconds) extent.longestRunMs = 1e3 * *request.longestSeconds;
    return extent;
}

void writeFile(const std::filesystem::path& path, const std::string& text) {
    AtomicFile file(path.string());
    file.writeAt(0, text.data(), text.size());
    file.commit();
}

std::string csvOf(const Json& runs) {
    std::string text =
        "variant,criterion,asked,voxels,covered,levels,spacing,median_ms,low_ms,high_ms,rounds,processor_ms,"
        "error_max,error_p999,error_rms,picture_rms,peak_memory_bytes\n";
    const auto cell = [](const Json& value) {
        return value.is_null()     ? std::string()
               : value.is_string() ? csvText(value.get<std::string>())
                                   : value.dump();
    };
    for (const Json& run : runs)
        text +=
            fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", cell(run["variant"]),
                        cell(run["criterion"]), cell(run["asked"]), cell(run["voxels"]), cell(run["covered"]),
                        cell(run["levels"]), cell(run["spacing"]), cell(run["ms"]["median"]),
                        cell(run["ms"]["low"]), cell(run["ms"]["high"]), cell(run["ms"]["count"]),
                        cell(run["processor_ms"]), cell(run["error"]["max"]), cell(run["error"]["p999"]),
                        cell(run["error"]["rms"]), cell(run["picture_rms"]), cell(run["peak_memory_bytes"]));
    return text;
}

class Benchmark {
  public:
    Benchmark(const BenchmarkRequest& request, Job& job)
        : request_(request), job_(job), extent_(extentOf(request)) {}

    Json run();

  private:
    void openMeshAndField();
    int chooseField(const TetMesh& mesh) const;
    void addBrickCases();
    void addElementCases();
    void addWarmCases();
    void addPaperCases();
    void addYardstick();
    void add(BrickCase bricks, const std::string& ladder, bool isOfElements = false);
    void add(WarmCase warm);
    void addPictures();
    void addMemory();
    void leaveOut(const std::string& what, const std::function<void()>& work);
    Json oracleJson();
    Json againJson() const;
    Json runsJson() const;
    Json elementsJson() const;
    Json warmJsons() const;
    Json paperJson() const;
    Json inputJson() const;
    GlThread* device();
    bool isMain(const BenchmarkVariant& variant) const { return variant.role == VariantRole::main; }
    void say(const std::string& text) const { job_.say(text); }

    struct Bricks {
        BrickCase bricks;
        std::size_t at = 0;
        bool isOfElements = false;
    };
    struct Warm {
        WarmCase warm;
        std::size_t at = 0;
    };

    const BenchmarkRequest& request_;
    Job& job_;
    Extent extent_;
    TetMesh mesh_;  // with the one field
    std::string meshName_;
    VariantList list_;
    std::vector<TimedCase> cases_;
    std::map<std::string, int> ladderCounts_;
    std::deque<Bricks> bricks_;
    std::deque<TetMesh> boxes_;
    std::deque<Warm> warm_;
    std::optional<PaperCases> paper_;
    std::size_t paperAt_ = 0, paperCount_ = 0;
    std::vector<std::string> absent_;
    std::string oracleCsv_;
};

void Benchmark::openMeshAndField() {
    if (request_.gradedElements > 0) {
        if (!request_.field.empty())
            throw InputError("--field: a graded box has one field only, which is taken");
        mesh_ = gradedBox(request_.gradedElements);
        meshName_ = "graded box";
        say(fmt::format("graded box: {} elements\n", formatCount(mesh_.elementCount())));
        return;
    }
    ReadOptions options;
    if (!request_.field.empty()) options.fields = {request_.field};
    MeshFile file = openMesh(request_.mesh, options, job_);
    say(importText(request_.mesh, file.statistics, file.mesh.boundsWorld()));
    const int field = chooseField(file.mesh);
    mesh_ = std::move(file.mesh);
    Field only = std::move(mesh_.fields[std::size_t(field)]);
    mesh_.fields.clear();
    mesh_.fields.push_back(std::move(only));
    meshName_ = std::filesystem::path(request_.mesh).filename().string();
}

/// The field asked for, or the first scalar one of the points.
int Benchmark::chooseField(const TetMesh& mesh) const {
    if (!request_.field.empty()) return selectFields(mesh, {{request_.field, request_.field}}).fields.at(0);
    for (std::size_t f = 0; f < mesh.fields.size(); ++f)
        if (mesh.fields[f].components == 1 && mesh.fields[f].location == FieldLocation::point) return int(f);
    throw InputError(fmt::format("{}: it has no scalar point field; choose one with --field", request_.mesh));
}

void Benchmark::add(BrickCase bricks, const std::string& ladder, bool isOfElements) {
    bricks_.push_back({std::move(bricks), cases_.size(), isOfElements});
    BrickCase& kept = bricks_.back().bricks;
    TimedCase one = timedCase(kept, fmt::format("{}, {}", ladder, kept.variant->name));
    if (isOfElements) {
        one.work = double(kept.mesh->elementCount());
        one.what += fmt::format(", {} elements", formatCount(kept.mesh->elementCount()));
    } else {
        // Refinement by error has no measure of its work ahead.
        const double points = kept.refine.resolution;
        one.work = points > 0 ? points * points * points : 1 / std::max(kept.bound, 1e-3);
        if (kept.criterion == "element size") one.work = std::pow(kept.refine.samplesPerElement, 3);
    }
    // Without the coarsest lattice of the first algorithm there would be nothing to tell.
    // Nor would a peer be in every plot.
    const bool isPeersFirst = kept.variant->role == VariantRole::peer && kept.criterion == "uniform" &&
                              ladderCounts_[one.ladder]++ < 2;
    one.isKept = cases_.empty() || isPeersFirst;
    cases_.push_back(std::move(one));
}

void Benchmark::addBrickCases() {
    for (const BenchmarkVariant& v : list_.variants) {
        if (v.role == VariantRole::variation) {
            add(uniformCase(v, mesh_, extent_.variationPoints), "uniform");
            continue;
        }
        for (const int points : extent_.resolutions) add(uniformCase(v, mesh_, points), "uniform");
        if (v.role == VariantRole::again) continue;
        const bool isFirst = &v == &list_.variants.front();
        if (request_.isQuick && v.role == VariantRole::published) continue;
        for (const double bound : extent_.bounds) add(errorCase(v, mesh_, bound), "error");
        if (!isMain(v) || (request_.isQuick && !isFirst)) continue;
        for (const double samples : extent_.elementSamples)
            add(elementSizeCase(v, mesh_, samples), "element size");
        for (const int points : extent_.focusPoints) add(focusCase(v, mesh_, points), "focus");
    }
}

void Benchmark::addElementCases() {
    for (const int elements : extent_.elements) boxes_.push_back(gradedBox(elements));
    for (const BenchmarkVariant& v : list_.variants) {
        if (v.role == VariantRole::variation || v.role == VariantRole::again) continue;
        for (const TetMesh& box : boxes_) {
            BrickCase bricks = uniformCase(v, box, extent_.elementsPoints);
            bricks.isErrorMeasured = false;
            add(std::move(bricks), "elements", true);
        }
    }
}

/// What fails by what a case may fail by is left out, with its reason.
void Benchmark::leaveOut(const std::string& what, const std::function<void()>& work) {
    if (const std::string why = whyItFailed(work); !why.empty())
        absent_.push_back(fmt::format("{}: {}", what, why));
}

/// The device that samples may stay on; null without one.
GlThread* Benchmark::device() {
    GlThread* device = nullptr;
    const bool isWanted = std::any_of(list_.variants.begin(), list_.variants.end(), [&](const auto& v) {
        return isMain(v) && v.resampler->info().isOnDevice;
    });
    if (isWanted) leaveOut("No samples are left on a device", [&] { device = &deviceOf(request_.bind); });
    return device;
}

void Benchmark::add(WarmCase warm) {
    warm_.push_back({std::move(warm), cases_.size()});
    const WarmCase& kept = warm_.back().warm;
    cases_.push_back(timedCase(warm_.back().warm, fmt::format("warm, {}, {}", kept.variant->name,
                                                              kept.device ? "device" : "blocks")));
}

void Benchmark::addWarmCases() {
    GlThread* device = this->device();
    const ElementIndex index(mesh_, job_.execution.withoutProgress());
    for (const BenchmarkVariant& v : list_.variants) {
        const bool isOther = v.bind.primitives == Primitives::processor && v.role == VariantRole::variation;
        if (!isMain(v) && (!isOther || request_.isQuick)) continue;
        for (GlThread* to : {static_cast<GlThread*>(nullptr), device}) {
            for (const auto& [edge, elements] : extent_.bricks)
                if (auto brick = warmBrick(v, mesh_, index, edge, elements, to)) add(std::move(*brick));
            add(warmFocus(v, mesh_, to));
            for (const int points : extent_.warmPoints) add(warmCube(v, mesh_, points, to));
            if (!device || (request_.isQuick && !v.resampler->info().isOnDevice)) break;
        }
    }
}

void Benchmark::addPaperCases() {
    leaveOut("The grids of 2001", [&] {
        paper_.emplace(mesh_, std::filesystem::path(meshName_).stem().string(), list_.variants,
                       extent_.paperPoints, request_.isQuick ? 1 : 3);
    });
    if (!paper_) return;
    paperAt_ = cases_.size();
    for (TimedCase& one : paper_->timedCases()) cases_.push_back(std::move(one));
    paperCount_ = cases_.size() - paperAt_;
}

void Benchmark::addYardstick() {
    TimedCase one;
    one.what = "yardstick";
    one.isKept = true;
    one.run = [](const Execution& execution) {
        CaseSample sample;
        sample.ms = runYardstick(execution.threadCount());
        return sample;
    };
    cases_.push_back(std::move(one));
}

/// Of the first algorithm's bricks, peers' and those as published; others have the same values.
void Benchmark::addPictures() {
    const Execution quiet = job_.execution.withoutProgress();
    std::optional<PictureReference> reference;
    leaveOut("No pictures are compared",
             [&] { reference.emplace(mesh_, mesh_.fields[0].name, extent_.pictureSize, quiet); });
    std::int64_t done = 0;
    for (Bricks& one : bricks_) {
        const BenchmarkVariant& v = *one.bricks.variant;
        job_.execution.report(Stage::comparing, done++, std::int64_t(bricks_.size()));
        const bool isWanted =
            &v == &list_.variants.front() || v.role == VariantRole::published || v.role == VariantRole::peer;
        if (!reference || !isWanted || one.isOfElements || !cases_[one.at].isTimed()) continue;
        leaveOut(cases_[one.at].what + ": no picture", [&] {
            // A picture of a vector is that of its length, which is the field of the reference's mesh.
            BrickResult result = makeBricks(one.bricks, reference->mesh(), quiet);
            one.bricks.pictureRms =
                reference->measureDrawn(*v.resampler, one.bricks.refine, result, "", quiet).drawn.all;
        });
    }
}

/// Of the whole program, in processes of its own.
void Benchmark::addMemory() {
    if (request_.program.empty() || request_.mesh.empty()) return;
    for (Bricks& one : bricks_) {
        const BenchmarkVariant& v = *one.bricks.variant;
        const bool isWanted =
            isMain(v) && !one.isOfElements && one.bricks.criterion == "uniform" &&
            (!request_.isQuick || one.bricks.refine.resolution == extent_.resolutions.back());
        if (!isWanted || !cases_[one.at].isTimed()) continue;
        one.bricks.peakMemoryBytes =
            peakMemoryOfProgram(request_.program, request_.mesh, mesh_.fields[0], one.bricks, job_.execution);
    }
}

Json Benchmark::oracleJson() {
    const Execution quiet = job_.execution.withoutProgress();
    OracleOptions options;
    options.places = extent_.places;
    options.lattices = extent_.lattices;
    options.seed = request_.seed;
    std::optional<OraclePlaces> places;
    Json variants = Json::array();
    std::vector<std::string> names;
    std::vector<OracleFigures> all;
    std::set<std::string> timedOnes;
    for (const Bricks& one : bricks_)
        if (cases_[one.at].isTimed()) timedOnes.insert(one.bricks.variant->name);
    leaveOut("Nothing is checked against exact arithmetic",
             [&] { places.emplace(mesh_, 0, options, quiet); });
    if (!places) return {{"places", 0}, {"variants", std::move(variants)}};
    for (const BenchmarkVariant& v : list_.variants) {
        if (v.role == VariantRole::again || !timedOnes.count(v.name)) continue;
        job_.execution.report(Stage::checking, std::int64_t(all.size()), std::int64_t(list_.variants.size()));
        leaveOut(v.name + " isn't checked against exact arithmetic", [&] {
            OracleFigures figures = places->measure(*v.resampler, v.bind, quiet);
            // What covers nothing has no error.
            const auto figureOrNull = [&](double value) {
                return figures.error.count > 0 ? Json(value) : Json(nullptr);
            };
            variants.push_back({{"variant", v.name},
                                {"max", figureOrNull(figures.error.max)},
                                {"p999", figureOrNull(figures.error.p999)},
                                {"rms", figureOrNull(figures.error.rms)},
                                {"places", figures.error.count},
                                {"holes", figures.holes},
                                {"spills", figures.spills}});
            names.push_back(v.name);
            all.push_back(std::move(figures));
        });
    }
    oracleCsv_ = places->csv(names, all);
    return {{"places", places->count()},
            {"lattices", places->latticeCount()},
            {"spill_voxels", options.spillVoxels},
            {"file", "oracle.csv"},
            {"variants", std::move(variants)}};
}

Json Benchmark::againJson() const {
    Json all = Json::array();
    for (const Bricks& twin : bricks_) {
        if (twin.bricks.variant->role != VariantRole::again || !cases_[twin.at].isTimed()) continue;
        for (const Bricks& one : bricks_) {
            if (one.bricks.variant != &list_.variants.front() || one.isOfElements ||
                one.bricks.asked != twin.bricks.asked || one.bricks.criterion != twin.bricks.criterion)
                continue;
            const TimedCase &first = cases_[one.at], &second = cases_[twin.at];
            if (!first.isTimed()) continue;
            const MedianInterval ratio = ratioOf(first, second);
            all.push_back({{"variant", one.bricks.variant->name},
                           {"criterion", one.bricks.criterion},
                           {"asked", one.bricks.asked},
                           {"ratio", intervalJson(ratio)},
                           {"agrees", ratio.holds(1)}});
        }
    }
    return all;
}

Json Benchmark::runsJson() const {
    Json all = Json::array();
    for (const Bricks& one : bricks_)
        if (!one.isOfElements && cases_[one.at].isTimed()) all.push_back(runJson(one.bricks, cases_[one.at]));
    return all;
}

Json Benchmark::elementsJson() const {
    Json points = Json::array();
    for (const Bricks& one : bricks_)
        if (one.isOfElements && cases_[one.at].isTimed())
            points.push_back({{"variant", one.bricks.variant->name},
                              {"x", one.bricks.mesh->elementCount()},
                              {"ms", intervalJson(cases_[one.at].interval())},
                              {"pairs", pairsOf(cases_[one.at].samples.back().statistics)}});
    return scalingJson(points);
}

Json Benchmark::warmJsons() const {
    Json all = Json::array();
    for (const Warm& one : warm_)
        if (cases_[one.at].isTimed()) all.push_back(warmJson(one.warm, cases_[one.at]));
    return all;
}

Json Benchmark::paperJson() const {
    return paper_ ? paper_->json(std::span(cases_).subspan(paperAt_, paperCount_)) : Json::object();
}

Json Benchmark::inputJson() const {
    const Field& field = mesh_.fields[0];
    double range = 0;
    for (int c = 0; c < field.components; ++c) range = std::max(range, fieldRange(field, c).width());
    return {{"mesh", meshName_},
            {"file", request_.mesh.empty() ? Json(nullptr) : Json(request_.mesh)},
            {"nodes", mesh_.points.size()},
            {"elements", mesh_.elementCount()},
            {"field", field.name},
            {"location", field.location == FieldLocation::cell ? "cell" : "point"},
            {"components", field.components},
            {"range", range}};
}

Json Benchmark::run() {
    const Timer timer;
    const std::filesystem::path folder(request_.folder);
    const std::optional<Json> earlier =
        request_.comparedWith.empty() ? std::nullopt : std::optional(readBenchmark(request_.comparedWith));
    openMeshAndField();
    const int threads = job_.execution.threadCount();
    if (earlier) checkComparable(*earlier, {{"input", inputJson()}, {"machine", {{"threads", threads}}}});
    list_ = listVariants(request_, job_.execution);
    absent_ = list_.absent;
    Json parts = Json::object();  // where the time goes
    Timer part;
    std::vector<MachineRates> rates;
    for (const int count : std::set<int>{1, threads})
        rates.push_back(measureMachine(count, request_.isQuick ? 3 : 7));
    parts["machine"] = part.restart() / 1000;
    addBrickCases();
    addElementCases();
    addWarmCases();
    addPaperCases();
    addYardstick();
    const int rounds = runRounds(cases_,
                                 {.rounds = extent_.mostRounds,
                                  .seed = request_.seed,
                                  .sampleMs = extent_.sampleMs,
                                  .longestRunMs = extent_.longestRunMs,
                                  .longestMs = 1e3 * extent_.seconds},
                                 job_.execution, [this](const std::string& text) { say(text); });
    for (const TimedCase& one : cases_)
        if (!one.leftOut.empty() && !one.isFollower) absent_.push_back(one.leftOut);
    parts["rounds"] = part.restart() / 1000;
    addPictures();
    parts["pictures"] = part.restart() / 1000;
    addMemory();
    parts["memory"] = part.restart() / 1000;

    Json document = documentHead("bench");
    document["input"] = inputJson();
    document["machine"] = machineJson(threads, list_.variants, request_.bind);
    Json variants = Json::array();
    for (const BenchmarkVariant& v : list_.variants) variants.push_back(variantJson(v));
    document["variants"] = std::move(variants);
    document["runs"] = runsJson();
    document["again"] = againJson();
    document["equal_error"] = equalErrorJson(document["runs"]);
    document["pareto"] = paretoJson(document["runs"], document["variants"]);
    document["scaling"] = {{"resolution", resolutionScalingJson(document["runs"])},
                           {"elements", elementsJson()},
                           {"elements_resolution", extent_.elementsPoints}};
    part.restart();
    document["oracle"] = oracleJson();
    parts["oracle"] = part.restart() / 1000;
    const double meshBytes =
        double(mesh_.tets.size() * sizeof mesh_.tets[0] + mesh_.points.size() * sizeof mesh_.points[0] +
               mesh_.fields[0].values.size() * sizeof(double));
    document["roofline"] =
        rooflineJson(document["runs"], document["variants"], meshBytes, mesh_.fields[0].components, rates);
    document["warm"] = warmJsons();
    document["paper"] = paperJson();
    document["yardstick"] = cases_.back().isTimed() ? intervalJson(cases_.back().interval()) : Json(nullptr);
    document["absent"] = absent_;
    document["advice"] = adviceOn(document);
    if (earlier) document["compared"] = compareBenchmarks(*earlier, document);
    document["settings"] = {{"quick", request_.isQuick},           {"rounds", rounds},
                            {"seconds", timer.elapsedMs() / 1000}, {"seconds_of_parts", std::move(parts)},
                            {"resolutions", extent_.resolutions},  {"seed", request_.seed}};

    writeFile(folder / "report.json", documentText(document));  // all else can be made of it
    writeFile(folder / "oracle.csv", oracleCsv_);
    writeFile(folder / "runs.csv", csvOf(document["runs"]));
    for (const PlotFile& plot : benchmarkPlots(document))
        writeFile(folder / "plots" / (plot.name + ".svg"), plot.svg);
    const std::string page = benchmarkPage(document);
    if (page.size() > kMostPageBytes)
        job_.warn(fmt::format("the page has {}: with fewer --points it is quicker to open",
                              formatBytes(std::int64_t(page.size()))));
    writeFile(folder / "index.html", page);
    say(benchmarkText(document, job_.textWidth) +
        fmt::format("wrote {}\n", (folder / "index.html").string()));
    return document;
}

/// The folder for the report, made with those above it where they aren't there; what was made is taken away
/// again when nothing comes of it.
class ReportFolder {
  public:
    explicit ReportFolder(const std::string& name) {
        std::error_code error;
        for (std::filesystem::path path = std::filesystem::absolute(name).lexically_normal();
             !path.empty() && !std::filesystem::exists(path, error) && path != path.parent_path();
             path = path.parent_path())
            made_.push_back(path);
        made_.insert(made_.begin(), std::filesystem::path(name) / "plots");
        std::filesystem::create_directories(name, error);
        if (error || !std::filesystem::is_directory(name))
            throw IoError(fmt::format("{}: the folder can't be made: {}", name,
                                      error ? error.message() : "something else has that name"));
    }
    ~ReportFolder() {
        std::error_code error;
        for (const std::filesystem::path& path : made_) std::filesystem::remove(path, error);  // empty ones
    }
    ReportFolder(const ReportFolder&) = delete;
    ReportFolder& operator=(const ReportFolder&) = delete;

  private:
    std::vector<std::filesystem::path> made_;  // the innermost first
};

void checkOutputs(const BenchmarkRequest& request, const Job& job) {
    std::vector<OutputPath> outputs{{"--json", job.reportPath}};
    for (const char* name : {"index.html", "report.json", "runs.csv", "oracle.csv"}) {
        outputs.push_back({"--output", (std::filesystem::path(request.folder) / name).string()});
        checkWritable(outputs.back().path);
    }
    // One that can be entered and written to.
    std::error_code error;
    std::filesystem::create_directory(std::filesystem::path(request.folder) / "plots", error);
    checkWritable((std::filesystem::path(request.folder) / "plots" / "noise.svg").string());
    std::vector<std::string> inputs;
    for (const std::string& input : {request.mesh, request.comparedWith})
        if (!input.empty()) inputs.push_back(input);
    checkOutputPaths(inputs, outputs);
}

}  // namespace

Json runBenchmark(const BenchmarkRequest& request, Job& job) {
    const ReportFolder folder(request.folder);
    checkOutputs(request, job);
    return Benchmark(request, job).run();
}

}  // namespace tessera
