#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>

#include "base/timer.h"
#include "commands.h"
#include "field_selection.h"
#include "files/atomic_file.h"
#include "import_mesh.h"
#include "mesh/field_range.h"
#include "output_paths.h"
#include "pictures/image.h"
#include "pictures/image_exr.h"
#include "report_text.h"
#include "resample/cut_plane.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {

namespace {

constexpr std::int64_t kLargestImageBytes = std::int64_t(4) << 30;
constexpr const char* kCoverageName = "coverage";

CutOptions cutOptions(const SliceArguments& a) {
    CutOptions options;
    if (!a.origin.empty()) options.originWorld = parseVector("--origin", a.origin);
    options.normal = parseVector("--normal", a.normal);
    if (!a.up.empty()) options.up = parseVector("--up", a.up);
    if (!a.size.empty()) {
        const bool square = a.size.find(',') == std::string::npos;
        const std::vector<double> size = parseNumbers("--size", a.size, square ? 1 : 2);
        options.sizeWorld = {size.front(), size.back()};
    }
    options.resolution = a.resolution;
    checkCutOptions(options);
    return options;
}

/// Wall milliseconds.
struct SliceTimes {
    double readMs = 0, indexMs = 0, queryMs = 0, resampleMs = 0, writeMs = 0;
};

std::string vectorText(const Vec3d& v) {
    return fmt::format("({:.3g}, {:.3g}, {:.3g})", v.x, v.y, v.z);
}

/// "z = 0.5", or the plane's normal and a point of it.
std::string planeText(const Cut& cut) {
    for (int k = 0; k < 3; ++k)
        if (std::abs(cut.normal[k]) == 1) return fmt::format("{} = {:.6g}", "xyz"[k], cut.originWorld[k]);
    return fmt::format("normal {} through {}", vectorText(cut.normal), vectorText(cut.originWorld));
}

ValueRange shownRange(const std::vector<float>& values, const std::vector<std::uint8_t>& coverage) {
    ValueRange range;
    for (std::size_t i = 0; i < values.size(); ++i)
        if (coverage[i] && std::isfinite(values[i])) {
            range.min = std::min(range.min, double(values[i]));
            range.max = std::max(range.max, double(values[i]));
        }
    return range;
}

/// The run of `tessera slice`.
class SliceRun {
  public:
    explicit SliceRun(const SliceArguments& arguments)
        : arguments_(arguments),
          exr_(chooseFormat(arguments.output, arguments.format, {"exr", "png"}) == "exr"),
          cutOptions_(cutOptions(arguments)),
          bind_(bindOptions(arguments.algorithm)),
          choices_(arguments.fields.empty() ? std::vector<FieldChoice>() : parseFields(arguments.fields)),
          choice_(chooseResampler(arguments.algorithm.name, bind_)),
          session_(arguments.common, arguments.output) {
        cutOptions_.spillVoxels = choice_.resampler->info().spillBoundVoxels;
        if (!choice_.reason.empty()) session_.print(choice_.reason + "\n");
    }
    int run();

  private:
    void checkUsage() const;
    void selectAll();
    void selectForPng();
    void checkMemory() const;
    void writeExrFile();
    void writePngFile();
    std::vector<ExrAttribute> attributes() const;
    void printResult();
    Json report() const;

    const SliceArguments& arguments_;
    const bool exr_;
    CutOptions cutOptions_;
    BindOptions bind_;
    std::vector<FieldChoice> choices_;
    ResamplerChoice choice_;
    Session session_;
    ImportedMesh file_;
    FieldSelection selection_;
    Cut cut_;
    CutSamples samples_;
    std::vector<std::string> channelNames_;  // one a channel that is written
    std::vector<ValueRange> ranges_;         // of the same
    SliceTimes times_;
};

void SliceRun::checkUsage() const {
    checkOutputPaths({arguments_.input},
                     {{"--output", arguments_.output}, {"--json", arguments_.common.jsonPath}});
    if (exr_ && (arguments_.component || !arguments_.range.empty()))
        throw InputError("--component and --range are for .png files: an EXR holds every component as it is");
    if (!exr_ && choices_.size() > 1)
        throw InputError(
            fmt::format("--field: a .png shows one field, got '{}'; a .exr holds many", arguments_.fields));
    checkWritable(arguments_.output);
    if (!arguments_.common.jsonPath.empty() && arguments_.common.jsonPath != "-")
        checkWritable(arguments_.common.jsonPath);
}

/// Every chosen field, with names that no other channel has and no viewer takes for a colour.
void SliceRun::selectAll() {
    std::set<std::string> taken{kCoverageName};
    const auto isTaken = [&](const auto& n) { return taken.contains(n) || isShownAsColour(n); };
    for (OutputField& field : selection_.outputs) {
        std::vector<std::string> names = exrChannelNames(field.name, field.components);
        while (std::any_of(names.begin(), names.end(), isTaken)) {
            field.name += "_";
            names = exrChannelNames(field.name, field.components);
        }
        taken.insert(names.begin(), names.end());
        channelNames_.insert(channelNames_.end(), names.begin(), names.end());
    }
}

/// One field: the first unless another one is chosen.
void SliceRun::selectForPng() {
    if (selection_.fields.empty())
        throw InputError(
            fmt::format("{}: the mesh has no field, so there is nothing to draw; a .exr would "
                        "hold the coverage",
                        arguments_.input));
    selection_.fields.erase(selection_.fields.begin() + 1, selection_.fields.end());
    selection_.outputs.erase(selection_.outputs.begin() + 1, selection_.outputs.end());
    const OutputField& field = selection_.outputs.front();
    selection_.channels = field.components;
    if (arguments_.component && *arguments_.component >= field.components)
        throw InputError(fmt::format("--component: {} has {} components, counted from 0, got {}", field.name,
                                     field.components, *arguments_.component));
    if (arguments_.component)
        channelNames_ = {exrChannelNames(field.name, field.components)[std::size_t(*arguments_.component)]};
    else
        channelNames_ = {field.components == 1 ? field.name : "|" + field.name + "|"};
}

void SliceRun::checkMemory() const {
    const CutFrame& frame = cut_.frame;
    const std::int64_t bytes =
        std::int64_t(frame.width) * frame.height * (4 * std::int64_t(selection_.channels) + 5);
    if (bytes <= kLargestImageBytes) return;
    const double fits = std::sqrt(double(kLargestImageBytes) / double(bytes)) * arguments_.resolution;
    throw InputError(fmt::format(
        "--resolution: {} x {} pixels of {} channels take {}, more than the {} allowed; {} would fit, or "
        "fewer fields (--field)",
        frame.width, frame.height, selection_.channels, formatBytes(bytes), formatBytes(kLargestImageBytes),
        std::int64_t(fits)));
}

std::vector<ExrAttribute> SliceRun::attributes() const {
    const Lattice& lattice = cut_.frame.lattice;
    std::vector<ExrAttribute> all{
        {"tesseraVersion", std::string(TESSERA_VERSION)},
        {"tesseraSource", std::filesystem::path(arguments_.input).filename().string()},
        {"tesseraAlgorithm", std::string(choice_.resampler->name())},
        {"tesseraOrigin", lattice.originWorld},
        {"tesseraU", lattice.uWorld},
        {"tesseraV", lattice.vWorld},
        {"tesseraNormal", cut_.normal},
        {"tesseraSpacing", cut_.frame.spacingWorld()}};
    if (const std::string repair = encodeRepair(repairOptions(arguments_.repair)); !repair.empty())
        all.push_back({"tesseraRepair", repair});
    if (!choice_.resampler->info().targetsAgree) all.push_back({"tesseraTarget", samples_.target});
    if (const std::string format = lossyFormat(bind_); !format.empty())
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

void SliceRun::writeExrFile() {
    ExrImage image{samples_.width, samples_.height, {}, attributes(), shownChannels(selection_)};
    for (std::size_t c = 0; c < channelNames_.size(); ++c) {
        ranges_.push_back(shownRange(samples_.channels[c], samples_.coverage));
        image.channels.push_back({channelNames_[c], std::move(samples_.channels[c])});
    }
    image.channels.push_back({kCoverageName, {samples_.coverage.begin(), samples_.coverage.end()}});
    writeExr(arguments_.output, image, session_.execution);
}

void SliceRun::writePngFile() {
    ScalarImage image{samples_.width, samples_.height, {}, std::move(samples_.coverage), {}};
    if (arguments_.component || samples_.channels.size() == 1) {
        image.values = std::move(samples_.channels[std::size_t(arguments_.component.value_or(0))]);
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
                                     arguments_.input, channelNames_.front(), planeText(cut_)));
    ranges_.push_back(range);
    PictureOptions options;
    options.title = channelNames_.front() + "  " + planeText(cut_);
    if (!arguments_.range.empty()) {
        const std::array<double, 2> ends = parseRange("--range", arguments_.range);
        options.min = ends[0];
        options.max = ends[1];
    }
    writeSlicePng(arguments_.output, image, options);
}

int SliceRun::run() {
    checkUsage();
    session_.progress.declare({{Stage::reading, 1},
                               {Stage::repairing, arguments_.repair.repair ? 1.0 : 0.0},
                               {Stage::planning, 0.2},
                               {Stage::sampling, 1},
                               {Stage::writing, 0.5}});
    Timer timer;
    const std::optional<RepairOptions> repair = repairOptions(arguments_.repair);
    file_ = importMesh(arguments_.input, {sourceNames(choices_, {}), arguments_.timeStep}, repair, session_);
    showRepair(arguments_.input, file_, repair, session_);
    times_.readMs = timer.elapsedMs();
    selection_ = selectFields(file_.mesh, choices_);
    exr_ ? selectAll() : selectForPng();
    timer.restart();
    session_.execution.report(Stage::planning, 0, 1);
    const PlaneQuery query(file_.mesh, session_.execution);
    times_.indexMs = timer.restart();
    cut_ = planCut(file_.mesh, query, cutOptions_);
    times_.queryMs = timer.elapsedMs();
    checkMemory();
    timer.restart();
    samples_ = sampleCut(file_.mesh, cut_, selection_.fields, *choice_.resampler, bind_, session_.execution);
    times_.resampleMs = timer.restart();
    if (samples_.statistics.count(counted::coveredPoints) == 0)
        throw InputError(
            fmt::format("{}: no pixel's centre on the plane {} lies in the mesh: nothing to show",
                        arguments_.input, planeText(cut_)));
    session_.execution.report(Stage::writing, 0, 1);
    exr_ ? writeExrFile() : writePngFile();
    times_.writeMs = timer.elapsedMs();
    printResult();
    if (!arguments_.common.jsonPath.empty()) writeJson(arguments_.common.jsonPath, report());
    return 0;
}

void SliceRun::printResult() {
    const std::int64_t elements = file_.mesh.elementCount();
    const CutFrame& frame = cut_.frame;
    std::string text = importText(arguments_.input, file_.statistics, file_.mesh.boundsWorld());
    text += fmt::format("  cut through {} elements: {} touched ({:.1f} %), {} hit\n", formatCount(elements),
                        formatCount(cut_.hits.touched),
                        100.0 * double(cut_.hits.touched) / double(std::max<std::int64_t>(1, elements)),
                        formatCount(std::int64_t(cut_.hits.elements.size())));
    for (std::size_t c = 0; c < channelNames_.size(); ++c)
        text += ranges_[c].empty() ? fmt::format("  {}: no finite value\n", channelNames_[c])
                                   : fmt::format("  {}: {:.6g} to {:.6g}\n", channelNames_[c], ranges_[c].min,
                                                 ranges_[c].max);
    text += fmt::format("  read {:.1f} ms, index {:.1f}, query {:.1f}, resample {:.1f}, write {:.1f}\n",
                        times_.readMs, times_.indexMs, times_.queryMs, times_.resampleMs, times_.writeMs);
    text += fmt::format("{}: {} x {} pixels of {:.6g}, plane {}, {} pixels in the mesh\n", arguments_.output,
                        frame.width, frame.height, frame.spacingWorld(), planeText(cut_),
                        formatCount(samples_.statistics.count(counted::coveredPoints)));
    session_.print(text);
}

Json vectorJson(const Vec3d& v) {
    return {v.x, v.y, v.z};
}

Json SliceRun::report() const {
    const CutFrame& frame = cut_.frame;
    Json channels = Json::array();
    for (std::size_t c = 0; c < channelNames_.size(); ++c)
        channels.push_back(
            {{"name", channelNames_[c]},
             {"range", ranges_[c].empty() ? Json(nullptr) : Json{ranges_[c].min, ranges_[c].max}}});
    Json json{{"schema", 1},
              {"program", "tessera"},
              {"version", TESSERA_VERSION},
              {"command", "slice"},
              {"input", arguments_.input},
              {"output", arguments_.output},
              {"algorithm", choice_.resampler->name()},
              {"algorithm_reason", choice_.reason},
              {"sample_format", nameOf(bind_.format)},
              {"target", samples_.target},
              {"threads", session_.execution.threadCount()}};
    json["stages"] = {{"read", times_.readMs},
                      {"index", times_.indexMs},
                      {"query", times_.queryMs},
                      {"resample", times_.resampleMs},
                      {"write", times_.writeMs}};
    json["plane"] = {{"origin", vectorJson(cut_.originWorld)}, {"normal", vectorJson(cut_.normal)}};
    json["image"] = {{"width", frame.width},
                     {"height", frame.height},
                     {"origin", vectorJson(frame.lattice.originWorld)},
                     {"u", vectorJson(frame.lattice.uWorld)},
                     {"v", vectorJson(frame.lattice.vWorld)},
                     {"spacing", frame.spacingWorld()},
                     {"covered_pixels", samples_.statistics.count(counted::coveredPoints)},
                     {"channels", channels}};
    json["elements"] = {{"total", file_.mesh.elementCount()},
                        {"boxes", cut_.hits.boxes},
                        {"touched", cut_.hits.touched},
                        {"hit", cut_.hits.elements.size()}};
    if (file_.repair) json["repair"] = repairJson(file_, repairOptions(arguments_.repair));
    json["statistics"] = statisticsJson(samples_.statistics);
    json["peak_memory_bytes"] = session_.peakMemoryBytes();
    return json;
}

}  // namespace

int runSlice(const SliceArguments& arguments) {
    return SliceRun(arguments).run();
}

}  // namespace tessera
