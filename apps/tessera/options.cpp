#include "options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "files/atomic_file.h"
#include "job/algorithm_list.h"
#include "job/output_paths.h"
#include "job/series_steps.h"
#include "job/transfer_function_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kLargestExtend = 64;
constexpr int kLargestLevels = 24;
constexpr int kLargestResolution = 1 << 20;
constexpr double kLargestHalf = 65504;
constexpr double kSmallestUnitScale = 1e-30, kLargestUnitScale = 1e30;

double parseNumber(const std::string& option, const std::string& text) {
    double value = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failure != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
        throw InputError(fmt::format("{}: expected a number, got '{}'", option, text));
    return value;
}

double parseShare(const std::string& option, const std::string& text) {
    const bool isPercent = text.ends_with('%');
    const std::string digits = isPercent ? text.substr(0, text.size() - 1) : text;
    const double share = parseNumber(option, digits) * (isPercent ? 0.01 : 1.0);
    if (!(share >= 0 && share <= 1))
        throw InputError(
            fmt::format("{}: expected a share from 0 to 1 or 0% to 100%, got '{}'", option, text));
    return share;
}

std::vector<std::string> split(const std::string& text, char separator) {
    std::vector<std::string> parts;
    std::size_t begin = 0;
    for (;;) {
        const std::size_t end = text.find(separator, begin);
        parts.push_back(text.substr(begin, end - begin));
        if (end == std::string::npos) return parts;
        begin = end + 1;
    }
}

void require(bool holds, const std::string& message) {
    if (!holds) throw InputError(message);
}

void requirePositive(const std::string& option, double value) {
    require(std::isfinite(value) && value > 0,
            fmt::format("{}: expected a number above 0, got {}", option, value));
}

void checkRanges(const ResampleArguments& a) {
    if (a.resolution)
        require(*a.resolution >= 2 && *a.resolution <= kLargestResolution,
                fmt::format("--resolution: expected 2 to {}, got {}", kLargestResolution, *a.resolution));
    if (a.spacing) requirePositive("--spacing", *a.spacing);
    require(!(a.spacing && a.resolution), "--spacing and --resolution exclude each other");
    requirePositive("--samples-per-element", a.request.refine.samplesPerElement);
    require(a.request.refine.samplesPerElement <= 1000,
            fmt::format("--samples-per-element: expected at most 1000, got {}",
                        a.request.refine.samplesPerElement));
    if (a.maxLevels)
        require(*a.maxLevels >= 1 && *a.maxLevels <= kLargestLevels,
                fmt::format("--max-levels: expected 1 to {}, got {}", kLargestLevels, *a.maxLevels));
    require(a.request.refine.brickCells == 8 || a.request.refine.brickCells == 16 ||
                a.request.refine.brickCells == 32 || a.request.refine.brickCells == 64,
            fmt::format("--brick-size: expected 8, 16, 32 or 64, got {}", a.request.refine.brickCells));
    if (a.file.extendLayers)
        require(*a.file.extendLayers >= 0 && *a.file.extendLayers <= kLargestExtend,
                fmt::format("--extend: expected 0 to {}, got {}", kLargestExtend, *a.file.extendLayers));
    if (a.file.voxelShift)
        require(std::abs(*a.file.voxelShift) <= 1,
                fmt::format("--voxel-shift: expected -1 to 1, got {}", *a.file.voxelShift));
    const double largest =
        a.request.write.halfFloat ? kLargestHalf : double(std::numeric_limits<float>::max());
    require(!a.background || std::abs(*a.background) <= largest,
            fmt::format("--background: expected a number within {:.9g}, the largest of {}-bit floats, got {}",
                        largest, a.request.write.halfFloat ? 16 : 32, a.background.value_or(0)));
    if (a.unitScale)
        require(*a.unitScale >= kSmallestUnitScale && *a.unitScale <= kLargestUnitScale,
                fmt::format("--unit-scale: expected {} to {}, got {}", kSmallestUnitScale, kLargestUnitScale,
                            *a.unitScale));
    require(a.request.dryRun || !a.request.output.empty(), "resample: no output given (-o out.vdb)");
}

Criteria parseCriteria(const std::string& text) {
    std::optional<Criteria> criteria;
    for (const std::string& word : split(text, ',')) {
        std::optional<Criterion> found;
        for (const Criterion one : {Criterion::uniform, Criterion::elementSize, Criterion::error,
                                    Criterion::focus, Criterion::visibility})
            if (nameOf(one) == word) found = one;
        require(
            found.has_value(),
            fmt::format(
                "--refine: expected uniform, element-size, error, focus, visibility, or several separated by "
                "commas, got {}",
                text));
        criteria = criteria ? *criteria | *found : Criteria(*found);
    }
    require(criteria.has_value(), "--refine: no criterion given");
    require(!criteria->has(Criterion::uniform) || criteria->isOnly(Criterion::uniform),
            "--refine uniform goes with no other criterion");
    return *criteria;
}

std::vector<Focus> parseFocus(const ResampleArguments& a) {
    require(!a.focus.empty(), "--refine focus needs --focus x,y,z");
    require(a.radius.size() == 1 || a.radius.size() == a.focus.size(),
            "--focus needs --radius r, once or for each place");
    std::vector<Focus> places;
    for (const std::string& text : a.focus) {
        const double radius = a.radius[a.radius.size() == 1 ? 0 : places.size()];
        requirePositive("--radius", radius);
        places.push_back(pointFocus(parseVector("--focus", text), radius));
    }
    return places;
}

RefineOptions refineOptions(const ResampleArguments& a) {
    RefineOptions r = a.request.refine;
    r.criterion = parseCriteria(a.refine);
    if (r.criterion.has(Criterion::uniform)) {
        require(a.resolution || a.spacing || !a.request.like.empty(),
                "--refine uniform needs --resolution N, --spacing h or --like file.vdb");
    } else if (r.criterion.has(Criterion::error)) {
        require(a.maxError.has_value(), "--refine error needs --max-error (a number, or a share such as 1%)");
    }
    require(!a.maxError || r.criterion.has(Criterion::error), "--max-error needs --refine error");
    if (r.criterion.has(Criterion::focus)) r.focus = parseFocus(a);
    const bool isByVisibility = r.criterion.has(Criterion::visibility);
    require(isByVisibility != a.transferFunction.empty(),
            isByVisibility ? "--refine visibility needs --transfer-function tf.json"
                           : "--transfer-function needs visibility in --refine");
    if (isByVisibility) r.transferFunction = readTransferFunction(a.transferFunction);
    require(r.criterion.has(Criterion::focus) || (a.focus.empty() && a.radius.empty()),
            "--focus and --radius need --refine focus");
    if (a.maxError) {
        const bool relative = a.maxError->ends_with('%');
        const std::string digits = relative ? a.maxError->substr(0, a.maxError->size() - 1) : *a.maxError;
        r.maxErrorIsRelative = relative;
        r.maxError = parseNumber("--max-error", digits) * (relative ? 0.01 : 1.0);
        requirePositive("--max-error", r.maxError);
    }
    r.resolution = a.resolution.value_or(0);
    r.spacingWorld = a.spacing.value_or(0);
    r.maxLevels = a.maxLevels.value_or(0);
    r.measure = a.errorMeasure == "rms" ? ErrorMeasure::rms : ErrorMeasure::max;
    if (!a.maxVoxels.empty()) r.maxVoxels = parseCount("--max-voxels", a.maxVoxels, false);
    if (!a.common.reader.maxMemory.empty())
        r.maxMemoryBytes = parseCount("--max-memory", a.common.reader.maxMemory, true);
    if (!a.bounds.empty()) r.boundsWorld = parseBounds(a.bounds);
    r.bind = bindOptions(a.algorithm);
    return r;
}

const OutputFormat& outputFormat(const ResampleArguments& a) {
    std::vector<std::string> kinds;
    for (const OutputFormat& format : outputFormats()) kinds.emplace_back(format.name);
    // A dry run needs no output.
    const std::string kind =
        chooseFormat(a.request.output.empty() ? kStandardOutput : a.request.output, a.format, kinds);
    return *std::find_if(outputFormats().begin(), outputFormats().end(),
                         [&](const OutputFormat& format) { return kind == format.name; });
}

VdbLayout chooseLayout(const ResampleArguments& a, const OutputFormat& format) {
    require(
        format.holdsLevels || a.file.layout != "levels",
        fmt::format("--layout levels: a .{} file ({}) holds one grid a field, at one spacing; a .vdb file "
                    "holds levels",
                    format.name, format.title));
    if (!a.file.layout.empty()) return a.file.layout == "flat" ? VdbLayout::flat : VdbLayout::levels;
    return format.holdsLevels ? VdbLayout::levels : VdbLayout::flat;
}

}  // namespace

BindOptions bindOptions(const AlgorithmArguments& a) {
    BindOptions options;
    options.target = a.gl;
    for (const SampleFormat format :
         {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8})
        if (nameOf(format) == a.sampleFormat) options.format = format;
    if (a.primitives == nameOf(Primitives::processor)) options.primitives = Primitives::processor;
    return options;
}

std::optional<RepairOptions> repairOptions(const RepairArguments& a) {
    if (!a.repair) return std::nullopt;
    RepairOptions options;
    if (a.aspect) options.limits.minAspect = *a.aspect;
    if (a.angle) options.limits.maxDihedralDegrees = *a.angle;
    if (!a.maxVolumeLoss.empty())
        options.maxVolumeLoss = parseShare("--repair-max-volume-loss", a.maxVolumeLoss);
    return options;
}

ResampleRequest resampleRequest(const ResampleArguments& typed) {
    ResampleArguments a = typed;
    a.file = settleProgram(a.request.program, a.file);
    checkRanges(a);
    ResampleRequest r = a.request;
    if (!a.times.empty()) r.times = parseTimes(a.times);
    r.algorithm = a.algorithm.name;
    r.refine = refineOptions(a);
    if (!a.fields.empty()) r.fields = parseFields(a.fields);
    if (!a.errorFields.empty()) {
        require(r.refine.criterion.has(Criterion::error), "--error-field needs --refine error");
        for (const FieldChoice& choice : parseFields(a.errorFields)) r.errorFields.push_back(choice.source);
    }
    require(r.log.empty() || !r.refine.criterion.has(Criterion::uniform),
            "--resume goes with element-size, error and focus in --refine, not with uniform");
    require(r.refine.measure == ErrorMeasure::max ||
                (r.log.empty() && !r.refine.criterion.has(Criterion::visibility)),
            "--error-measure rms goes neither with --resume nor with visibility: it is a figure of the whole "
            "mesh");
    r.format = &outputFormat(a);
    r.write.layout = chooseLayout(a, *r.format);
    require(
        !r.write.brickStatistics || r.write.layout == VdbLayout::levels,
        "--brick-statistics: bricks are kept by the levels layout alone, which .vdb files have by default");
    r.write.background = float(a.background.value_or(0));
    if (a.background) r.write.hiddenValue = float(*a.background);
    r.write.upAxis = a.file.upAxis == "y" ? UpAxis::y : a.file.upAxis == "z" ? UpAxis::z : UpAxis::keep;
    r.write.voxelShift = a.file.voxelShift.value_or(0);
    r.write.unitScale = a.unitScale.value_or(0);
    r.write.sampleFormat = lossyFormat(r.refine.bind);
    r.write.criterion = nameOf(r.refine.criterion);
    r.write.maxVoxels = r.refine.maxVoxels;
    r.shape.layout = r.write.layout;
    r.shape.layers = a.file.extendLayers.value_or(r.write.layout == VdbLayout::flat ? 1 : 0);
    r.shape.halfFloat = r.write.halfFloat;
    r.shape.leafErrors = r.write.brickStatistics;
    r.shape.boundsWorld = r.refine.boundsWorld;
    r.shape.maxFlatVoxels = r.refine.maxVoxels;
    r.format->check(r.write);
    r.repair = repairOptions(a.repair);
    return r;
}

std::int64_t parseCount(const std::string& option, const std::string& text, bool binary) {
    const auto fail = [&] {
        throw InputError(
            fmt::format("{}: expected a count above 0 such as 500K, 64M or 2G, got '{}'", option, text));
    };
    std::string digits = text;
    double scale = 1;
    if (!digits.empty() && std::isalpha(static_cast<unsigned char>(digits.back()))) {
        const std::size_t power =
            std::string("KMGT").find(char(std::toupper(static_cast<unsigned char>(digits.back()))));
        if (power == std::string::npos) fail();
        scale = std::pow(binary ? 1024.0 : 1000.0, double(power + 1));
        digits.pop_back();
    }
    double value = 0;
    const auto [end, failure] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (failure != std::errc{} || end != digits.data() + digits.size() || !std::isfinite(value)) fail();
    value = std::floor(value * scale);
    if (value < 1 || value > 1e18) fail();
    return std::int64_t(value);
}

std::vector<FieldChoice> parseFields(const std::string& text) {
    std::vector<FieldChoice> choices;
    std::set<std::string> names;
    for (const std::string& part : split(text, ',')) {
        const std::size_t equals = part.find('=');
        FieldChoice choice{part.substr(0, equals),
                           equals == std::string::npos ? part : part.substr(equals + 1),
                           equals != std::string::npos};
        if (choice.source.empty() || choice.name.empty())
            throw InputError(fmt::format("--field: expected a,b=newname,..., got '{}'", text));
        if (!names.insert(choice.name).second)
            throw InputError(fmt::format("--field: the name '{}' is there twice", choice.name));
        choices.push_back(std::move(choice));
    }
    return choices;
}

std::vector<double> parseNumbers(const std::string& option, const std::string& text, std::size_t count) {
    const std::vector<std::string> parts = split(text, ',');
    if (parts.size() != count)
        throw InputError(
            fmt::format("{}: expected {} numbers with commas between them, got '{}'", option, count, text));
    std::vector<double> values;
    for (const std::string& part : parts) values.push_back(parseNumber(option, part));
    return values;
}

std::array<double, 2> parseRange(const std::string& option, const std::string& text) {
    const std::vector<double> ends = parseNumbers(option, text, 2);
    require(ends[0] < ends[1], fmt::format("{}: expected a < b, got '{}'", option, text));
    return {ends[0], ends[1]};
}

Vec3d parseVector(const std::string& option, const std::string& text) {
    const std::vector<double> v = parseNumbers(option, text, 3);
    return {v[0], v[1], v[2]};
}

std::array<int, 2> parsePictureSize(const std::string& option, const std::string& text) {
    constexpr int kMost = 32768;
    const std::size_t cross = std::min(text.find('x'), text.size());
    std::array<int, 2> size{};
    const char* const ends[] = {text.data() + cross, text.data() + text.size()};
    const char* from = text.data();
    for (std::size_t i = 0; i < 2; ++i) {
        const auto [end, failure] = std::from_chars(from, ends[i], size[i]);
        require(cross < text.size() && failure == std::errc{} && end == ends[i] && size[i] >= 1 &&
                    size[i] <= kMost,
                fmt::format("{}: expected WIDTHxHEIGHT, each from 1 to {}, got '{}'", option, kMost, text));
        from = end + 1;
    }
    return size;
}

Box3d parseBounds(const std::string& text) {
    const std::vector<double> v = parseNumbers("--bounds", text, 6);
    const Box3d box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
    for (int axis = 0; axis < 3; ++axis)
        require(box.min[axis] < box.max[axis], fmt::format("--bounds: expected {0}0 < {0}1, got {1} and {2}",
                                                           "xyz"[axis], box.min[axis], box.max[axis]));
    return box;
}

}  // namespace tessera
