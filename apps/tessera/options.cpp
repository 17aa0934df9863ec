#include "options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "import_mesh.h"

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

void addRefineOptions(CLI::App& command, ResampleArguments& a) {
    const std::string group = "Where to sample how finely";
    a.common.reader.memoryBoundsRun = true;
    command
        .add_option(
            "--refine", a.refine,
            "uniform: one spacing. element-size: spacing follows the local element size. error: refine until "
            "the measured error is within --max-error")
        ->check(CLI::IsMember({"uniform", "element-size", "error"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--resolution", a.resolution,
                    "lattice points along the longest axis, at the finest level")
        ->group(group);
    command.add_option("--spacing", a.spacing, "spacing of the finest level, in world units")->group(group);
    command
        .add_option("--samples-per-element", a.samplesPerElement,
                    "element-size: samples along a typical element edge")
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--max-levels", a.maxLevels,
                    "levels of spacing at most, each twice the one below (default: 8; for error no bound)")
        ->group(group);
    command
        .add_option("--max-error", a.maxError,
                    "error: bound in field units, or a share of each field's range such as 1%")
        ->group(group);
    command.add_option("--error-measure", a.errorMeasure, "error: which figure the bound holds for")
        ->check(CLI::IsMember({"max", "rms"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--error-field", a.errorFields,
                    "error: fields a,b that the bound holds for (default: all point fields chosen)")
        ->group(group);
    command.add_option("--brick-size", a.brickSize, "cells along a brick's edge: 8, 16, 32 or 64")
        ->capture_default_str()
        ->group(group);
    command.add_option("--bounds", a.bounds, "sample only inside the box x0,y0,z0,x1,y1,z1 (world units)")
        ->group(group);
    command.add_option("--like", a.like, "use the lattice (origin and finest spacing) of this .vdb file")
        ->group(group);
    command
        .add_option("--max-voxels", a.maxVoxels,
                    "bound on stored voxels, e.g. 500M (default: from the memory there is)")
        ->group(group);
    command
        .add_option(
            "--max-memory", a.common.reader.maxMemory,
            "bound on the memory for reading, the mesh, its samples and the work on them, e.g. 4G; with "
            "--reader in-process reading itself has no bound")
        ->group(group);
    command
        .add_flag("--dry-run", a.dryRun,
                  "print voxels, bytes and predicted time of each layout; write nothing")
        ->group(group);
}

void addOutputOptions(CLI::App& command, ResampleArguments& a) {
    const std::string group = "What to write";
    command.add_option("--field", a.fields, "fields to sample: a,b=newname,... (default: all)")->group(group);
    command
        .add_option("--layout", a.layout,
                    "levels: one grid a field and level. flat: one grid a field at the finest spacing")
        ->check(CLI::IsMember({"levels", "flat"}))
        ->capture_default_str()
        ->group(group);
    command.add_flag("--half", a.half, "store values as 16-bit floats")->group(group);
    command
        .add_option("--extend", a.extendLayers,
                    "layers of voxels written outside the mesh, with the value at the nearest mesh point "
                    "(default: 1 for "
                    "the flat layout, which Blender and Houdini interpolate without looking at the mesh; 0 "
                    "for levels)")
        ->group(group);
    command.add_option("--background", a.background, "value of voxels that are not stored")
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--unit-scale", a.unitScale,
                    "file units per world unit (default: 1, or a power of ten when voxels are tiny)")
        ->group(group);
    command
        .add_option("--up-axis", a.upAxis,
                    "turn the grid so that this axis of the file points up: keep, y or z")
        ->check(CLI::IsMember({"keep", "y", "z"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--time-step", a.timeStep,
                    "files with several steps: which one, counted from 0 (default: the last)")
        ->group(group);
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
    const double largest = a.half ? kLargestHalf : double(std::numeric_limits<float>::max());
    require(std::abs(a.background) <= largest,
            fmt::format("--background: expected a number within {:.9g}, the largest of {}-bit floats, got {}",
                        largest, a.half ? 16 : 32, a.background));
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

/// Leaves --max-memory out where the command has it already.
void addReaderOptions(CLI::App& command, ReaderArguments& a) {
    const std::string group = "How to read the mesh";
    command
        .add_option(
            "--reader", a.kind,
            "isolated: in a process of its own, so that a damaged file can't crash or exhaust this one. "
            "in-process: for debugging")
        ->check(CLI::IsMember({"isolated", "in-process"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option(
            "--max-read-time", a.maxSeconds,
            "seconds that reading may take (default: 3 of processor time and 60 until the end, and more "
            "for large files); not with --reader in-process")
        ->group(group);
    if (!command.get_option_no_throw("--max-memory"))
        command
            .add_option(
                "--max-memory", a.maxMemory,
                "memory that reading may take, e.g. 4G (default: 640M and 96 times the file's size); not "
                "with --reader in-process")
            ->group(group);
}

}  // namespace

void addCommonOptions(CLI::App& command, CommonOptions& options) {
    command
        .add_option("--threads", options.threads,
                    "worker threads (default: one for every processor); the result never depends on it")
        ->check(CLI::Range(0, 1024));
    command.add_flag("-q,--quiet", options.quiet, "print nothing but errors");
    command.add_option("--json", options.jsonPath,
                       "write a report as JSON to this file, or to standard output for -");
    addReaderOptions(command, options.reader);
}

void addAlgorithmOptions(CLI::App& command, AlgorithmArguments& a) {
    const std::string group = "How to sample";
    command
        .add_option("--algorithm", a.name,
                    "the resampler, or auto: the fastest that this machine has (results may then differ from "
                    "machine to machine)")
        ->capture_default_str()
        ->group(group);
    addBindOptions(command, a);
}

void addBindOptions(CLI::App& command, AlgorithmArguments& a) {
    const std::string group = "How to sample";
    command.add_option("--gl", a.gl, "OpenGL platform (default: the first that can be had)")
        ->check(CLI::IsMember({"egl-device", "egl-surfaceless", "osmesa"}))
        ->group(group);
    command
        .add_option(
            "--sample-format", a.sampleFormat,
            "what an OpenGL resampler keeps values in; r16 and r8 divide the field's range into steps")
        ->check(CLI::IsMember({"r32f", "r16f", "r16", "r8"}))
        ->capture_default_str()
        ->group(group);
    command
        .add_option("--classification", a.classification,
                    "how an OpenGL resampler decides what an element covers: by arithmetic, which meets the "
                    "contract, or as the method was published, to see what that costs")
        ->check(CLI::IsMember({"arithmetic", "published"}))
        ->capture_default_str()
        ->group(group);
}

void refuseReaderBounds(const ReaderArguments& a, const std::string& why) {
    require(!a.maxSeconds, "--max-read-time bounds the reading of a mesh: " + why);
    require(a.maxMemory.empty(), "--max-memory bounds the reading of a mesh here: " + why);
}

CLI::Validator numbersWithin(double first, double last) {
    const auto check = [first, last](std::string& text) {
        double value = 0;
        const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
        const bool isNumber = failure == std::errc{} && end == text.data() + text.size();
        return isNumber && value >= first && value <= last
                   ? std::string()
                   : fmt::format("expected {:g} to {:g}, got '{}'", first, last, text);
    };
    return {check, fmt::format("in [{:g} - {:g}]", first, last), ""};
}

BindOptions bindOptions(const AlgorithmArguments& a) {
    BindOptions options;
    options.target = a.gl;
    for (const SampleFormat format :
         {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8})
        if (nameOf(format) == a.sampleFormat) options.format = format;
    if (a.classification == "published") options.classification = Classification::published;
    return options;
}

std::string lossyFormat(const BindOptions& options) {
    return options.format == SampleFormat::r32f ? std::string() : std::string(nameOf(options.format));
}

void addResampleOptions(CLI::App& command, ResampleArguments& a) {
    command.add_option("mesh", a.input, "mesh file, a pattern such as 'run_*.vtu', or a .pvd file")
        ->required();
    command.add_option("-o,--output", a.output,
                       "the .vdb file; #### stands for the step's number in a series");
    addRefineOptions(command, a);
    addOutputOptions(command, a);
    addAlgorithmOptions(command, a.algorithm);
    addRepairOptions(command, a.repair);
    addCommonOptions(command, a.common);
    command.footer(R"(Examples:
  tessera resample flow.vtu -o flow.vdb
  tessera resample flow.vtu -o flow.vdb --refine error --max-error 1% --error-field pressure --brick-size 8
  tessera resample flow.vtu -o flow.vdb --refine uniform --resolution 256 --layout flat --half
  tessera resample flow.vtu -o flow.vdb --field velocity=v,pressure=density --max-memory 8G --dry-run
  tessera resample 'run_*.vtu' -o 'out_####.vdb' --json report.json)");
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
    s.write.layout = a.layout == "flat" ? VdbLayout::flat : VdbLayout::levels;
    s.write.halfFloat = a.half;
    s.write.background = float(a.background);
    s.write.upAxis = a.upAxis == "y" ? UpAxis::y : a.upAxis == "z" ? UpAxis::z : UpAxis::keep;
    s.write.unitScale = a.unitScale.value_or(0);
    s.write.maxFlatVoxels = s.refine.maxVoxels;
    s.refine.bind = bindOptions(a.algorithm);
    s.write.algorithm = a.algorithm.name;
    s.write.sampleFormat = lossyFormat(s.refine.bind);
    s.write.criterion = a.refine;
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
                           equals == std::string::npos ? part : part.substr(equals + 1)};
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
