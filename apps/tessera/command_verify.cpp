#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/timer.h"
#include "commands.h"
#include "import_mesh.h"
#include "mesh_files/mesh_series.h"
#include "output_paths.h"
#include "refine/measure_error.h"
#include "report_text.h"
#include "tessera/error.h"
#include "tessera/registry.h"
#include "vdb/outside_reader.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_read.h"
#include "vdb/vdb_write.h"
#include "verify/check_voxels.h"

namespace tessera {

namespace {

constexpr int kExitClaimFails = 2;
constexpr double kRounding = 1e-9;                  // of the claimed figure
constexpr double kFloatRounding = 1.0 / (1 << 21);  // of the largest value
constexpr double kHalfRounding = 1.0 / (1 << 10);

/// Index into mesh.fields for each field of the file. Throws InputError when the mesh does not have it so.
std::vector<int> matchFields(const TetMesh& mesh, const VdbFile& file, const std::string& meshPath) {
    std::vector<int> fields;
    for (const OutputField& output : file.fields) {
        const auto found = std::find_if(mesh.fields.begin(), mesh.fields.end(), [&](const Field& field) {
            return field.name == output.sourceName && field.components == output.components &&
                   (field.location == FieldLocation::point) == (output.location == "point");
        });
        if (found == mesh.fields.end())
            throw InputError(
                fmt::format("{} has no {} field '{}' of {} components, which the .vdb file was made from",
                            meshPath, output.location, output.sourceName, output.components));
        fields.push_back(int(found - mesh.fields.begin()));
    }
    return fields;
}

double largestValue(const Field& field) {
    double largest = 0;
    for (const double value : field.values)
        if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
    return largest;
}

struct Comparison {
    std::string field, figure;
    double claimed = 0, measured = 0, allowed = 0;
    bool holds() const {
        // A figure that isn't finite stands as null in the file.
        return std::abs(claimed - measured) <= allowed ||
               (!std::isfinite(claimed) && !std::isfinite(measured));
    }
};

std::vector<Comparison> compareReports(const TetMesh& mesh, std::span<const int> fields,
                                       const ErrorReport& claimed, const ErrorReport& measured,
                                       bool halfFloat) {
    std::vector<Comparison> rows;
    const auto count = [&](const char* figure, std::int64_t a, std::int64_t b) {
        rows.push_back({"", figure, double(a), double(b), 0});
    };
    count("covered points", claimed.coveredPoints, measured.coveredPoints);
    count("nodes", claimed.nodes, measured.nodes);
    count("centroids", claimed.centroids, measured.centroids);
    count("samples beside absent voxels", claimed.incomplete, measured.incomplete);
    if (claimed.fields.size() != measured.fields.size())
        throw InputError(fmt::format("the file's error report has {} fields, the file {}",
                                     claimed.fields.size(), measured.fields.size()));
    for (std::size_t f = 0; f < claimed.fields.size(); ++f) {
        const FieldError &a = claimed.fields[f], &b = measured.fields[f];
        const double rounding = halfFloat ? kHalfRounding : kFloatRounding;
        const double valueError = rounding * std::max(1.0, std::sqrt(double(b.components))) *
                                  largestValue(mesh.fields[std::size_t(fields[f])]);
        const auto add = [&](const char* figure, double x, double y) {
            rows.push_back({a.name, figure, x, y, kRounding * std::abs(x) + valueError});
        };
        add("max", a.max, b.max);
        add("99.9 %", a.p999, b.p999);
        add("rms", a.rms, b.rms);
        add("range", a.range, b.range);
    }
    return rows;
}

std::string comparisonText(const std::vector<Comparison>& rows) {
    std::vector<std::vector<std::string>> table{
        {"field", "figure", "in the file", "measured", "difference", ""}};
    for (const Comparison& r : rows)
        table.push_back({r.field.empty() ? "(all)" : r.field, r.figure, fmt::format("{:.9g}", r.claimed),
                         fmt::format("{:.9g}", r.measured), fmt::format("{:.2g}", r.measured - r.claimed),
                         r.holds() ? "holds" : "DOES NOT HOLD"});
    return formatTable(table, {.keys = 2});
}

Json comparisonJson(const std::vector<Comparison>& rows) {
    Json list = Json::array();
    for (const Comparison& r : rows)
        list.push_back({{"field", r.field},
                        {"figure", r.figure},
                        {"claimed", r.claimed},
                        {"measured", r.measured},
                        {"allowed_difference", r.allowed},
                        {"holds", r.holds()}});
    return list;
}

/// The figures that a program's reading must keep to.
std::vector<Comparison> compareReading(const TetMesh& mesh, std::span<const int> fields,
                                       const ErrorReport& claimed, const OutsideReading& reading) {
    std::vector<Comparison> rows;
    for (std::size_t f = 0; f < reading.max.size(); ++f) {
        const FieldError& a = claimed.fields[f];
        // At most, so what is below holds too. OpenVDB interpolates in 32-bit floats. A range beyond double
        // stands as null in the file. Voxels that are small beside their distance from the origin are placed
        // with a rounding that is worth something.
        const double range = std::isfinite(a.range) ? a.range : 0;
        const double rounding = kFloatRounding * std::sqrt(double(a.components)) *
                                largestValue(mesh.fields[std::size_t(fields[f])]);
        rows.push_back({a.name, "max, by OpenVDB's sampler", a.max, std::max(a.max, reading.max[f]),
                        kRounding * a.max + 2 * rounding + 1e-6 * range + reading.rounding[f]});
    }
    return rows;
}

Json voxelsJson(const VoxelCheck& check, const OutsideReading& reading, const VdbFile& file) {
    const PointCheck& s = check.samples;
    return {{"covered", s.covered},
            {"holes", s.holes},
            {"spills", s.spills},
            {"wrong_values", s.wrongValues},
            {"undecided", s.undecided},
            {"largest_share_of_allowed", s.largestShare},
            {"derived", check.derived},
            {"wrong_derived", check.wrongDerived},
            {"missing_extension", check.missingDerived},
            {"unexpected_extension", check.unexpected},
            {"inactive_not_background", file.strayValues},
            {"grid_problems", file.gridProblems},
            {"read_places", reading.places},
            {"incomplete_places", reading.incomplete}};
}

std::string voxelsText(const VoxelCheck& check, const OutsideReading& reading, const VdbFile& file) {
    const PointCheck& s = check.samples;
    std::string text = fmt::format(
        "  every voxel against the mesh: {} in the mesh; {} holes, {} spills, {} wrong values\n",
        formatCount(s.covered), formatCount(s.holes), formatCount(s.spills), formatCount(s.wrongValues));
    if (s.undecided > 0)
        text += fmt::format("  {} voxels lie in elements too thin to check their values\n",
                            formatCount(s.undecided));
    if (check.derived + check.missingDerived + check.unexpected > 0)
        text += fmt::format(
            "  worked out anew from the samples: {} voxels; {} wrong, {} missing, {} unexpected\n",
            formatCount(check.derived), formatCount(check.wrongDerived), formatCount(check.missingDerived),
            formatCount(check.unexpected));
    if (file.strayValues > 0)
        text +=
            fmt::format("  {} inactive voxels don't hold the background\n", formatCount(file.strayValues));
    for (const std::string& problem : file.gridProblems) text += "  " + problem + "\n";
    text +=
        fmt::format("  read by OpenVDB's sampler: {} nodes and centroids, {} of them beside absent voxels\n",
                    formatCount(reading.places), formatCount(reading.incomplete));
    for (const std::string& problem : {check.firstProblem, reading.firstProblem})
        if (!problem.empty()) text += "  " + problem + "\n";
    return text;
}

/// The step that was asked for, or else the step of a .pvd file that has the .vdb file's time.
int stepOf(const VerifyArguments& arguments, const VdbFile& file) {
    if (arguments.timeStep >= 0 || !file.time || !isCollectionName(arguments.meshPath))
        return arguments.timeStep;
    for (const SeriesStep& step : listSeries(std::span(&arguments.meshPath, 1)))
        if (step.time == file.time) return int(step.number);
    throw InputError(fmt::format("{} has no step of time {}, which {} was made from", arguments.meshPath,
                                 *file.time, arguments.vdbPath));
}

SampleFormat formatOf(const std::string& name) {
    for (const SampleFormat format : {SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8})
        if (nameOf(format) == name) return format;
    return SampleFormat::r32f;
}

VoxelCheck check(const TetMesh& mesh, std::span<const int> fields, VdbFile& file,
                 const Execution& execution) {
    const Resampler& resampler = namedResampler(file.algorithm);
    BindOptions bind;
    bind.target = file.target;
    bind.format = formatOf(file.sampleFormat);
    StoredVoxels stored;
    stored.tree = &file.tree;
    stored.store = &file.store;
    stored.bricks = file.bricks ? &*file.bricks : nullptr;
    stored.flatLevel = file.flatLevel;
    stored.boundsWorld = file.boundsWorld;
    stored.layers = file.layers;
    stored.bounds = {
        resampler.info().spillBoundVoxels, resampler.info().placeBoundVoxels, bind.format, {}, true};
    if (file.halfFloat) {
        const std::vector<bool> toHalf = gridsInHalf(file.fields, file.store);
        std::size_t g = 0;
        for (const OutputField& field : file.fields) {
            const int grids = field.components == 3 ? 1 : field.components;
            for (int k = 0; k < grids; ++k, ++g)
                stored.bounds.isHalf.insert(stored.bounds.isHalf.end(), std::size_t(field.components / grids),
                                            toHalf[g] ? 1 : 0);
        }
    }
    return checkVoxels(mesh, fields, stored, resampler, bind, execution);
}

}  // namespace

int runVerify(const VerifyArguments& arguments) {
    checkOutputPaths({arguments.meshPath, arguments.vdbPath}, {{"--json", arguments.common.jsonPath}});
    Session session(arguments.common);
    session.progress.declare({{Stage::reading, 1}, {Stage::measuring, 1}, {Stage::comparing, 1}});
    VdbFile file = readVdb(arguments.vdbPath);
    ReadOptions options;
    options.timeStep = stepOf(arguments, file);
    for (const OutputField& output : file.fields) options.fields.push_back(output.sourceName);
    Timer timer;
    // The same repair as the file's mesh went through: only then do its claims speak of this mesh.
    const std::optional<RepairOptions> repair = decodeRepair(file.repair);
    const ImportedMesh imported = importMesh(arguments.meshPath, options, repair, session);
    const TetMesh& mesh = imported.mesh;
    StageTimes times;
    times.readMs = timer.restart();
    const std::vector<int> fields = matchFields(mesh, file, arguments.meshPath);
    const bool isFlat = file.layout == VdbLayout::flat;
    const NearestOnDemand nearest(mesh, session.execution.threads);
    MeasureOptions measure;
    measure.boundsWorld = file.boundsWorld;
    measure.outside = isFlat ? Outside::missing : Outside::nearest;
    ErrorReport measured =
        measureError(mesh, fields, file.tree, file.store, nearest, session.execution, measure);
    // With an extension only voxels without a finite value are absent; checkVoxels tells of others.
    if (file.layers > 0) measured.incomplete = 0;
    std::vector<Comparison> rows = compareReports(mesh, fields, file.report, measured, file.halfFloat);
    const VoxelCheck voxels = check(mesh, fields, file, session.execution);
    OutsideReading reading = readAsOutsider(arguments.vdbPath, file, mesh, fields, session.execution);
    if (isFlat && file.layers == 0) {  // nothing is promised then, and the report counts the gaps
        reading.incomplete = 0;
        reading.firstProblem.clear();
    }
    const std::vector<Comparison> read = compareReading(mesh, fields, file.report, reading);
    rows.insert(rows.end(), read.begin(), read.end());
    times.verifyMs = timer.elapsedMs();
    const bool holds = voxels.isGood() && reading.incomplete == 0 && file.strayValues == 0 &&
                       file.gridProblems.empty() &&
                       std::all_of(rows.begin(), rows.end(), [](const Comparison& r) { return r.holds(); });

    showRepair(arguments.meshPath, imported, repair, session);
    session.print(fmt::format("{} against {}\n", arguments.vdbPath, arguments.meshPath) +
                  comparisonText(rows) + errorText(measured) + voxelsText(voxels, reading, file) +
                  (holds ? "verified: the file's claims hold\n" : ""));
    if (!arguments.common.jsonPath.empty()) {
        Json json{{"schema", 1},
                  {"program", "tessera"},
                  {"version", TESSERA_VERSION},
                  {"command", "verify"},
                  {"mesh_file", arguments.meshPath},
                  {"vdb_file", arguments.vdbPath},
                  {"holds", holds},
                  {"comparison", comparisonJson(rows)},
                  {"voxels", voxelsJson(voxels, reading, file)},
                  {"coverage", coverageJson(measured)},
                  {"error", errorJson(measured)},
                  {"stages", stagesJson(times)}};
        if (repair) json["repair"] = repairJson(imported, repair);
        writeJson(arguments.common.jsonPath, json);
    }
    if (!holds)
        throw InputError(
            fmt::format("{}: its claims do not hold for {}", arguments.vdbPath, arguments.meshPath));
    return 0;
}

}  // namespace tessera
