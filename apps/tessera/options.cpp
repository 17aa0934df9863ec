#include "options.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "files/atomic_file.h"
#include "output_paths.h"
#include "refine/refine_options.h"
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
    requirePositive("--samples-per-element", a.samplesPerElement);
    require(a.samplesPerElement <= 1000,
            fmt::format("--samples-per-element: expected at most 1000, got {}", a.samplesPerElement));
    if (a.maxLevels)
        require(*a.maxLevels >= 1 && *a.maxLevels <= kLargestLevels,
                fmt::format("--max-levels: expected 1 to {}, got {}", kLargestLevels, *a.maxLevels));
    require(a.brickSize == 8 || a.brickSize == 16 || a.brickSize == 32 || a.brickSize == 64,
            fmt::format("--brick-size: expected 8, 16, 32 or 64, got {}", a.brickSize));
    if (a.extendLayers)
        require(*a.extendLayers >= 0 && *a.extendLayers <= kLargestExtend,
                fmt::format("--extend: expected 0 to {}, got {}", kLargestExtend, *a.extendLayers));
    if (a.voxelShift)
        require(std::abs(*a.voxelShift) <= 1,
                fmt::format("--voxel-shift: expected -1 to 1, got {}", *a.voxelShift));
    const double largest = a.half ? kLargestHalf : double(std::numeric_limits<float>::max());
    require(!a.background || std::abs(*a.background) <= largest,
            fmt::format("--background: expected a number within {:.9g}, the largest of {}-bit floats, got {}",
                        largest, a.half ? 16 : 32, a.background.value_or(0)));
    if (a.unitScale)
        require(*a.unitScale >= kSmallestUnitScale && *a.unitScale <= kLargestUnitScale,
                fmt::format("--unit-scale: expected {} to {}, got {}", kSmallestUnitScale, kLargestUnitScale,
                            *a.unitScale));
    require(a.dryRun || !a.output.empty(), "resample: no output given (-o out.vdb)");
}

RefineOptions refineOptions(const ResampleArguments& a) {
    RefineOptions r;
    if (a.refine == "uniform") {
        r.criterion = Criterion::uniform;
        require(a.resolution || a.spacing || !a.like.empty(),
                "--refine uniform needs --resolution N, --spacing h or --like file.vdb");
    } else if (a.refine == "error") {
        r.criterion = Criterion::error;
        require(a.maxError.has_value(), "--refine error needs --max-error (a number, or a share such as 1%)");
    }
    require(!a.maxError || r.criterion == Criterion::error, "--max-error needs --refine error");
    if (a.maxError) {
        const bool relative = a.maxError->ends_with('%');
        const std::string digits = relative ? a.maxError->substr(0, a.maxError->size() - 1) : *a.maxError;
        r.maxErrorIsRelative = relative;
        r.maxError = parseNumber("--max-error", digits) * (relative ? 0.01 : 1.0);
        requirePositive("--max-error", r.maxError);
    }
    r.brickCells = a.brickSize;
    r.resolution = a.resolution.value_or(0);
    r.spacingWorld = a.spacing.value_or(0);
    r.samplesPerElement = a.samplesPerElement;
    r.maxLevels = a.maxLevels.value_or(0);
    r.measure = a.errorMeasure == "rms" ? ErrorMeasure::rms : ErrorMeasure::max;
    if (!a.maxVoxels.empty()) r.maxVoxels = parseCount("--max-voxels", a.maxVoxels, false);
    if (!a.common.reader.maxMemory.empty())
        r.maxMemoryBytes = parseCount("--max-memory", a.common.reader.maxMemory, true);
    if (!a.bounds.empty()) r.boundsWorld = parseBounds(a.bounds);
    return r;
}

const OutputFormat& outputFormat(const ResampleArguments& a) {
    std::vector<std::string> kinds;
    for (const OutputFormat& format : outputFormats()) kinds.emplace_back(format.name);
    // A dry run needs no output.
    const std::string kind = chooseFormat(a.output.empty() ? kStandardOutput : a.output, a.format, kinds);
    return *std::find_if(outputFormats().begin(), outputFormats().end(),
                         [&](const OutputFormat& format) { return kind == format.name; });
}

VdbLayout chooseLayout(const ResampleArguments& a, const OutputFormat& format) {
    require(
        format.holdsLevels || a.layout != "levels",
        fmt::format("--layout levels: a .{} file ({}) holds one grid a field, at one spacing; a .vdb file "
                    "holds levels",
                    format.name, format.title));
    if (!a.layout.empty()) return a.layout == "flat" ? VdbLayout::flat : VdbLayout::levels;
    return format.holdsLevels ? VdbLayout::levels : VdbLayout::flat;
}

}  // namespace

void refuseReaderBounds(const ReaderArguments& a, const std::string& why) {
    require(!a.maxSeconds, "--max-read-time bounds the reading of a mesh: " + why);
    require(a.maxMemory.empty(), "--max-memory bounds the reading of a mesh here: " + why);
}

BindOptions bindOptions(const AlgorithmArguments& a) {
    BindOptions options;
    options.target = a.gl;
    for (const SampleFormat format :
         {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8})
        if (nameOf(format) == a.sampleFormat) options.format = format;
    return options;
}

std::string lossyFormat(const BindOptions& options) {
    return options.format == SampleFormat::r32f ? std::string() : std::string(nameOf(options.format));
}

ResampleSettings checkedSettings(const ResampleArguments& a) {
    checkRanges(a);
    ResampleSettings s;
    s.refine = refineOptions(a);
    if (!a.fields.empty()) s.fields = parseFields(a.fields);
    if (!a.errorFields.empty()) {
        require(a.refine == "error", "--error-field needs --refine error");
        for (const FieldChoice& choice : parseFields(a.errorFields)) s.errorFields.push_back(choice.source);
    }
    s.format = &outputFormat(a);
    s.write.layout = chooseLayout(a, *s.format);
    s.write.halfFloat = a.half;
    s.write.background = float(a.background.value_or(0));
    if (a.background) s.write.hiddenValue = float(*a.background);
    s.write.upAxis = a.upAxis == "y" ? UpAxis::y : a.upAxis == "z" ? UpAxis::z : UpAxis::keep;
    s.write.voxelShift = a.voxelShift.value_or(0);
    s.write.unitScale = a.unitScale.value_or(0);
    s.shape.layout = s.write.layout;
    s.shape.layers = a.extendLayers.value_or(s.write.layout == VdbLayout::flat ? 1 : 0);
    s.shape.halfFloat = a.half;
    s.shape.boundsWorld = s.refine.boundsWorld;
    s.shape.maxFlatVoxels = s.refine.maxVoxels;
    s.refine.bind = bindOptions(a.algorithm);
    s.write.algorithm = a.algorithm.name;
    s.write.sampleFormat = lossyFormat(s.refine.bind);
    s.write.criterion = a.refine;
    s.write.maxVoxels = s.refine.maxVoxels;
    s.format->check(s.write);
    return s;
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

Box3d parseBounds(const std::string& text) {
    const std::vector<double> v = parseNumbers("--bounds", text, 6);
    const Box3d box{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
    for (int axis = 0; axis < 3; ++axis)
        require(box.min[axis] < box.max[axis], fmt::format("--bounds: expected {0}0 < {0}1, got {1} and {2}",
                                                           "xyz"[axis], box.min[axis], box.max[axis]));
    return box;
}

}  // namespace tessera
