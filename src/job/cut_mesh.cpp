#include "job/cut_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "base/timer.h"
#include "files/atomic_file.h"
#include "job/algorithm_choice.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/report_text.h"
#include "job/wrap_text.h"
#include "pictures/image.h"
#include "pictures/image_exr.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kLargestImageBytes = std::int64_t(4) << 30;
constexpr const char* kCoverageName = "coverage";

std::string vectorText(const Vec3d& v) {
    return fmt::format("({:.3g}, {:.3g}, {:.3g})", v.x, v.y, v.z);
}

/// "z = 0.5", or the plane's normal and a point of it.
std::string planeText(const Cut& cut) {
    for (int k = 0; k < 3; ++k)
        if (std::abs(cut.normal[k]) == 1) return fmt::format("{} = {:.6g}", "xyz"[k], cut.originWorld[k]);
    return fmt::format("normal {} through {}", vectorText(cut.normal), vectorText(cut.originWorld));
}

/// The work of cutMesh.
class CutRun {
  public:
    CutRun(const CutRequest& request, Job& job)
        : request_(request),
          job_(job),
          exr_(chooseFormat(request.output, request.format, {"exr", "png"}) == "exr"),
          choice_(request.algorithm, request.bind, job) {}
    CutResult run();

  private:
    void checkUsage() const;
    void selectAll();
    void selectForPng();
    void checkMemory() const;
    void writeExrFile();
    void writePngFile();
    std::vector<ExrAttribute> attributes() const;
    std::string resultText() const;

    const CutRequest& request_;
    Job& job_;
    const bool exr_;
    AlgorithmChoice choice_;
    FieldSelection selection_;
    CutSamples samples_;
    CutResult result_;
};

void CutRun::checkUsage() const {
    checkOutputPaths({request_.input}, {{"--output", request_.output}, {"--json", job_.reportPath}});
    if (exr_ && (request_.component || request_.range))
        throw InputError("--component and --range are for .png files: an EXR holds every component as it is");
    if (!exr_ && request_.fields.size() > 1) {
        std::string got;
        for (const FieldChoice& c : request_.fields)
            got += (got.empty() ? "" : ",") + c.source + (c.named ? "=" + c.name : std::string());
        throw InputError(fmt::format("--field: a .png shows one field, got '{}'; a .exr holds many", got));
    }
    checkWritable(request_.output);
    checkReportPath(job_);
}

/// Every chosen field, with names that no other channel has and no viewer takes for a colour.
void CutRun::selectAll() {
    std::set<std::string> taken{kCoverageName};
    const auto isTaken = [&](const auto& n) { return taken.contains(n) || isShownAsColour(n); };
    for (OutputField& field : selection_.outputs) {
        std::vector<std::string> names = exrChannelNames(field.name, field.components);
        while (std::any_of(names.begin(), names.end(), isTaken)) {
            field.name += "_";
            names = exrChannelNames(field.name, field.components);
        }
        taken.insert(names.begin(), names.end());
        result_.channelNames.insert(result_.channelNames.end(), names.begin(), names.end());
    }
}

/// One field: the first unless another one is chosen.
void CutRun::selectForPng() {
    if (selection_.fields.empty())
        throw InputError(
            fmt::format("{}: the mesh has no field, so there is nothing to draw; a .exr would "
                        "hold the coverage",
                        request_.input));
    selection_.fields.erase(selection_.fields.begin() + 1, selection_.fields.end());
    selection_.outputs.erase(selection_.outputs.begin() + 1, selection_.outputs.end());
    const OutputField& field = selection_.outputs.front();
    selection_.channels = field.components;
    if (request_.component && *request_.component >= field.components)
        throw InputError(fmt::format("--component: {} has {} components, counted from 0, got {}", field.name,
                                     field.components, *request_.component));
    if (request_.component)
        result_.channelNames = {
            exrChannelNames(field.name, field.components)[std::size_t(*request_.component)]};
    else
        result_.channelNames = {field.components == 1 ? field.name : "|" + field.name + "|"};
}

void CutRun::checkMemory() const {
    const CutFrame& frame = result_.cut.frame;
    const std::int64_t bytes =
        std::int64_t(frame.width) * frame.height * (4 * std::int64_t(selection_.channels) + 5);
    if (bytes <= kLargestImageBytes) return;
    const double fits = std::sqrt(double(kLargestImageBytes) / double(bytes)) * request_.cut.resolution;
    throw InputError(fmt::format(
        "--resolution: {} x {} pixels of {} channels take {}, more than the {} allowed; {} would fit, or "
        "fewer fields (--field)",
        frame.width, frame.height, selection_.channels, formatBytes(bytes), formatBytes(kLargestImageBytes),
        std::int64_t(fits)));
}

std::vector<ExrAttribute> CutRun::attributes() const {
    const Lattice& lattice = result_.cut.frame.lattice;
    std::vector<ExrAttribute> all{
        {"tesseraVersion", std::string(TESSERA_VERSION)},
        {"tesseraSource", std::filesystem::path(request_.input).filename().string()},
        {"tesseraAlgorithm", std::string(choice_.resampler().name())},
        {"tesseraOrigin", lattice.originWorld},
        {"tesseraU", lattice.uWorld},
        {"tesseraV", lattice.vWorld},
        {"tesseraNormal", result_.cut.normal},
        {"tesseraSpacing", result_.cut.frame.spacingWorld()}};
    if (const std::string repair = encodeRepair(request_.repair); !repair.empty())
        all.push_back({"tesseraRepair", repair});
    if (!choice_.resampler().info().targetsAgree) all.push_back({"tesseraTarget", samples_.target});
    if (const std::string format = lossyFormat(request_.bind); !format.empty())
        all.push_back({"tesseraSampleFormat", format});
    return all;
}

/// R, G, B and A of channels that end with the coverage: the first field, one component as grey, two or three
/// as they are, of more the first three. Without a field the coverage.
std::vector<int> shownChannels(const FieldSelection& selection) {
    const int coverage = selection.channels;
    if (selection.outputs.empty()) return {coverage, coverage, coverage, coverage};
    switch (selection.outputs.front().components) {
        case 1:
            return {0, 0, 0, coverage};
        case 2:
            return {0, 1, kExrZeros, coverage};
        default:
            return {0, 1, 2, coverage};
    }
}

void CutRun::writeExrFile() {
    ExrImage image{samples_.width, samples_.height, {}, attributes(), shownChannels(selection_)};
    for (std::size_t c = 0; c < result_.channelNames.size(); ++c) {
        result_.ranges.push_back(shownRange(samples_.channels[c], samples_.coverage));
        image.channels.push_back({result_.channelNames[c], std::move(samples_.channels[c])});
    }
    image.channels.push_back({kCoverageName, {samples_.coverage.begin(), samples_.coverage.end()}});
    writeExr(request_.output, image, job_.execution);
}

void CutRun::writePngFile() {
    ScalarImage image{samples_.width, samples_.height, {}, std::move(samples_.coverage), {}};
    if (request_.component || samples_.channels.size() == 1) {
        image.values = std::move(samples_.channels[std::size_t(request_.component.value_or(0))]);
    } else {
        image.values.resize(samples_.channels.front().size());
        for (std::size_t i = 0; i < image.values.size(); ++i) {
            double sum = 0;
            for (const std::vector<float>& channel : samples_.channels)
                sum += double(channel[i]) * double(channel[i]);
            image.values[i] = float(std::sqrt(sum));
        }
    }
    const ValueRange range = shownRange(image.values, image.coverage);
    if (range.empty())
        throw InputError(fmt::format("{}: {} has no finite value on the plane {}: nothing to draw",
                                     request_.input, result_.channelNames.front(), planeText(result_.cut)));
    result_.ranges.push_back(range);
    PictureOptions options;
    options.title =
        shortened(result_.channelNames.front(), kTitleNameColumns) + "  " + planeText(result_.cut);
    if (request_.range) {
        options.min = (*request_.range)[0];
        options.max = (*request_.range)[1];
    }
    writeSlicePng(request_.output, image, options);
}

std::string CutRun::resultText() const {
    const std::int64_t elements = result_.file.mesh.elementCount();
    const CutFrame& frame = result_.cut.frame;
    std::string text = importText(request_.input, result_.file.statistics, result_.file.boundsWorld);
    text +=
        fmt::format("  cut through {} elements: {} touched ({:.1f} %), {} hit\n", formatCount(elements),
                    formatCount(result_.cut.hits.touched),
                    100.0 * double(result_.cut.hits.touched) / double(std::max<std::int64_t>(1, elements)),
                    formatCount(std::int64_t(result_.cut.hits.elements.size())));
    for (std::size_t c = 0; c < result_.channelNames.size(); ++c)
        text += result_.ranges[c].empty() ? fmt::format("  {}: no finite value\n", result_.channelNames[c])
                                          : fmt::format("  {}: {:.6g} to {:.6g}\n", result_.channelNames[c],
                                                        result_.ranges[c].min, result_.ranges[c].max);
    text += fmt::format("  read {:.1f} ms, index {:.1f}, query {:.1f}, resample {:.1f}, write {:.1f}\n",
                        result_.times.readMs, result_.times.indexMs, result_.times.queryMs,
                        result_.times.resampleMs, result_.times.writeMs);
    return text + fmt::format("{}: {} x {} pixels of {:.6g}, plane {}, {} pixels in the mesh\n",
                              request_.output, frame.width, frame.height, frame.spacingWorld(),
                              planeText(result_.cut),
                              formatCount(samples_.statistics.count(counted::coveredPoints)));
}

CutResult CutRun::run() {
    checkUsage();
    job_.execution.declare({{Stage::reading, 1},
                            {Stage::repairing, request_.repair ? 1.0 : 0.0},
                            {Stage::planning, 0.2},
                            {Stage::sampling, 1},
                            {Stage::writing, 0.5}});
    Timer timer;
    result_.file = importMesh(request_.input, {sourceNames(request_.fields, {}), request_.timeStep},
                              request_.repair, job_);
    const TetMesh& mesh = result_.file.mesh;
    tellRepair(request_.input, result_.file, job_);
    result_.times.readMs = timer.elapsedMs();
    selection_ = selectFields(mesh, request_.fields);
    exr_ ? selectAll() : selectForPng();
    timer.restart();
    job_.execution.report(Stage::planning, 0, 1);
    const PlaneQuery query(mesh, job_.execution);
    result_.times.indexMs = timer.restart();
    CutOptions options = request_.cut;
    // A plane meets about as many elements of a cube.
    choice_.chooseFor({std::int64_t(2 * std::pow(double(mesh.elementCount()), 2.0 / 3)),
                       std::int64_t(options.resolution) * options.resolution});
    choice_.run([&](const Resampler& resampler) {
        options.spillVoxels = resampler.info().spillBoundVoxels;
        result_.cut = planCut(mesh, query, options);
        result_.times.queryMs = timer.restart();
        checkMemory();
        samples_ = sampleCut(mesh, result_.cut, selection_.fields, resampler, request_.bind, job_.execution);
        result_.times.resampleMs = timer.restart();
    });
    if (samples_.statistics.count(counted::coveredPoints) == 0)
        throw InputError(
            fmt::format("{}: no pixel's centre on the plane {} lies in the mesh: nothing to show",
                        request_.input, planeText(result_.cut)));
    job_.execution.report(Stage::writing, 0, 1);
    exr_ ? writeExrFile() : writePngFile();
    result_.times.writeMs = timer.elapsedMs();
    job_.say(resultText());
    result_.algorithm = choice_.resampler().name();
    result_.algorithmReason = choice_.reason();
    result_.target = samples_.target;
    result_.statistics = samples_.statistics;
    return std::move(result_);
}

}  // namespace

CutResult cutMesh(const CutRequest& request, Job& job) {
    return CutRun(request, job).run();
}

Json cutJson(const CutRequest& request, const CutResult& result, const Job& job) {
    const Cut& cut = result.cut;
    const CutFrame& frame = cut.frame;
    Json channels = Json::array();
    for (std::size_t c = 0; c < result.channelNames.size(); ++c)
        channels.push_back({{"name", result.channelNames[c]}, {"range", rangeJson(result.ranges[c])}});
    Json json = documentHead("slice");
    json["input"] = request.input;
    json["output"] = request.output;
    json["algorithm"] = result.algorithm;
    json["algorithm_reason"] = result.algorithmReason;
    json["sample_format"] = nameOf(request.bind.format);
    json["target"] = result.target;
    json["threads"] = job.execution.threadCount();
    json["stages"] = {{"read", result.times.readMs},
                      {"index", result.times.indexMs},
                      {"query", result.times.queryMs},
                      {"resample", result.times.resampleMs},
                      {"write", result.times.writeMs}};
    json["plane"] = {{"origin", vectorJson(cut.originWorld)}, {"normal", vectorJson(cut.normal)}};
    json["image"] = {{"width", frame.width},
                     {"height", frame.height},
                     {"origin", vectorJson(frame.lattice.originWorld)},
                     {"u", vectorJson(frame.lattice.uWorld)},
                     {"v", vectorJson(frame.lattice.vWorld)},
                     {"spacing", frame.spacingWorld()},
                     {"covered_pixels", result.statistics.count(counted::coveredPoints)},
                     {"channels", channels}};
    json["elements"] = {{"total", result.file.mesh.elementCount()},
                        {"boxes", cut.hits.boxes},
                        {"touched", cut.hits.touched},
                        {"hit", cut.hits.elements.size()}};
    addRepair(json, result.file);
    json["statistics"] = statisticsJson(result.statistics);
    json["peak_memory_bytes"] = peakMemoryBytes(job);
    return json;
}

}  // namespace tessera
