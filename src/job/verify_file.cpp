#include "job/verify_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/timer.h"
#include "job/field_selection.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/report_text.h"
#include "job/vdb_contents.h"
#include "mesh_files/mesh_series.h"
#include "reader/isolated_vdb.h"
#include "refine/measure_error.h"
#include "tessera/error.h"
#include "tessera/registry.h"
#include "vdb/vdb_write.h"

namespace tessera {

namespace {

constexpr double kRounding = 1e-9;                  // of the claimed figure
constexpr double kFloatRounding = 1.0 / (1 << 21);  // of the largest value
constexpr double kHalfRounding = 1.0 / (1 << 10);

/// Index into mesh.fields for each field of the file. Throws InputError when the mesh does not have it so.
std::vector<int> matchFields(const TetMesh& mesh, const VdbFile& file, const std::string& meshPath) {
    std::vector<int> fields;
    for (const OutputField& output : file.fields) {
        fields.push_back(findSource(mesh, output));
        if (fields.back() < 0)
            throw InputError(
                fmt::format("{} has no {} field '{}' of {} components, which the .vdb file was made from",
                            meshPath, output.location, output.sourceName, output.components));
    }
    return fields;
}

double largestValue(const Field& field) {
    double largest = 0;
    for (const double value : field.values)
        if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
    return largest;
}

/// What rounding a field's values can make of its errors.
double roundingOf(const Field& field, bool halfFloat) {
    return (halfFloat ? kHalfRounding : kFloatRounding) * std::max(1.0, std::sqrt(double(field.components))) *
           largestValue(field);
}

std::vector<Claim> compareReports(const TetMesh& mesh, std::span<const int> fields,
                                  const ErrorReport& claimed, const ErrorReport& measured, bool halfFloat) {
    std::vector<Claim> rows;
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
        const double valueError = roundingOf(mesh.fields[std::size_t(fields[f])], halfFloat);
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

/// How many bricks are what their statistics say. @param leafErrors as measured now.
std::vector<Claim> compareStatistics(const TetMesh& mesh, std::span<const int> fields, const VdbFile& file,
                                     const ErrorReport& measured, const std::vector<double>& leafErrors,
                                     const Execution& execution) {
    const BrickStatistics& stated = *file.statistics;
    const BrickStatistics found = measureStatistics(file.fields, file.store, execution);
    double rounding = 0;
    for (std::size_t f = 0; f < fields.size(); ++f)
        if (const double range = measured.fields[f].range; range > 0)
            rounding =
                std::max(rounding, roundingOf(mesh.fields[std::size_t(fields[f])], file.halfFloat) / range);
    std::int64_t sameErrors = 0;
    for (std::size_t leaf = 0; leaf < leafErrors.size(); ++leaf) {
        const auto error = double(stated.errors[leaf]);  // not a number: nothing is claimed
        sameErrors += !(std::abs(error - leafErrors[leaf]) > kFloatRounding * error + rounding);
    }
    const auto bricks = double(stated.brickCount());
    return {{"", "bricks with these samples", bricks, double(countSameSamples(stated, found)), 0},
            {"", "bricks with these errors", bricks, double(sameErrors), 0}};
}

std::string claimsText(const std::vector<Claim>& claims, std::size_t width) {
    TableRows rows{{"field", "figure", "in the file", "measured", "difference", ""}};
    for (const Claim& c : claims)
        rows.push_back({c.field.empty() ? "(all)" : c.field, c.figure, fmt::format("{:.9g}", c.stated),
                        fmt::format("{:.9g}", c.measured), fmt::format("{:.2g}", c.measured - c.stated),
                        c.holds() ? "holds" : "DOES NOT HOLD"});
    return formatTable(rows, width, {.keys = 2});
}

Json claimsJson(const std::vector<Claim>& claims) {
    Json list = Json::array();
    for (const Claim& c : claims)
        list.push_back({{"field", c.field},
                        {"figure", c.figure},
                        {"claimed", c.stated},
                        {"measured", c.measured},
                        {"allowed_difference", c.allowed},
                        {"holds", c.holds()}});
    return list;
}

/// The figures that a program's reading must keep to.
std::vector<Claim> compareReading(const TetMesh& mesh, std::span<const int> fields,
                                  const ErrorReport& claimed, const OutsideReading& reading) {
    std::vector<Claim> rows;
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

Json voxelsJson(const Verification& v) {
    const VoxelCheck& check = v.voxels;
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
            {"inactive_not_background", v.strayValues},
            {"grid_problems", v.gridProblems},
            {"read_places", v.reading.places},
            {"incomplete_places", v.reading.incomplete}};
}

std::string voxelsText(const Verification& v) {
    const VoxelCheck& check = v.voxels;
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
    if (v.strayValues > 0)
        text += fmt::format("  {} inactive voxels don't hold the background\n", formatCount(v.strayValues));
    for (const std::string& problem : v.gridProblems) text += "  " + problem + "\n";
    text +=
        fmt::format("  read by OpenVDB's sampler: {} nodes and centroids, {} of them beside absent voxels\n",
                    formatCount(v.reading.places), formatCount(v.reading.incomplete));
    for (const std::string& problem : {check.firstProblem, v.reading.firstProblem})
        if (!problem.empty()) text += "  " + problem + "\n";
    return text;
}

/// The step that was asked for, or else the step of a .pvd file that has the .vdb file's time.
int stepOf(const VerifyRequest& request, const VdbFile& file) {
    if (request.timeStep >= 0 || !file.time || !isCollectionName(request.meshPath)) return request.timeStep;
    for (const SeriesStep& step : listSeries(std::span(&request.meshPath, 1)))
        if (step.time == file.time) return int(step.number);
    throw InputError(fmt::format("{} has no step of time {}, which {} was made from", request.meshPath,
                                 *file.time, request.vdbPath));
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

bool Claim::holds() const {
    // A figure that isn't finite stands as null in the file.
    return std::abs(stated - measured) <= allowed || (!std::isfinite(stated) && !std::isfinite(measured));
}

bool Verification::holds() const {
    return voxels.isGood() && reading.incomplete == 0 && strayValues == 0 && gridProblems.empty() &&
           std::all_of(claims.begin(), claims.end(), [](const Claim& c) { return c.holds(); });
}

Verification verifyFile(const VerifyRequest& request, Job& job) {
    checkOutputPaths({request.meshPath, request.vdbPath}, {{"--json", job.reportPath}});
    const auto isVdb = [](const std::string& path) {
        return std::filesystem::path(path).extension() == ".vdb";
    };
    if (isVdb(request.meshPath) && !isVdb(request.vdbPath))
        throw InputError(request.meshPath +
                         " is given as the mesh: the mesh comes first, then the .vdb file");
    job.execution.declare({{Stage::reading, 1}, {Stage::measuring, 1}, {Stage::comparing, 1}});
    VdbFile file = openVdb(request.vdbPath, VdbContents::all, job);
    ReadOptions options;
    options.timeStep = stepOf(request, file);
    for (const OutputField& output : file.fields) options.fields.push_back(output.sourceName);
    Timer timer;
    Verification v;
    // The same repair as the file's mesh went through: only then do its claims speak of this mesh.
    v.mesh = importMesh(request.meshPath, options, decodeRepair(file.repair), job);
    const TetMesh& mesh = v.mesh.mesh;
    v.times.readMs = timer.restart();
    const std::vector<int> fields = matchFields(mesh, file, request.meshPath);
    const bool isFlat = file.layout == VdbLayout::flat;
    const NearestOnDemand nearest(mesh, job.execution.threads);
    MeasureOptions measure;
    measure.boundsWorld = file.boundsWorld;
    measure.outside = isFlat ? Outside::missing : Outside::nearest;
    std::vector<double> leafErrors;
    if (file.statistics) measure.leafErrors = &leafErrors;
    v.measured = measureError(mesh, fields, file.tree, file.store, nearest, job.execution, measure);
    // With an extension only voxels without a finite value are absent; checkVoxels tells of others.
    if (file.layers > 0) v.measured.incomplete = 0;
    v.claims = compareReports(mesh, fields, file.report, v.measured, file.halfFloat);
    if (file.statistics)
        for (const Claim& claim :
             compareStatistics(mesh, fields, file, v.measured, leafErrors, job.execution))
            v.claims.push_back(claim);
    v.voxels = check(mesh, fields, file, job.execution);
    v.strayValues = file.strayValues;
    v.gridProblems = file.gridProblems;
    const GridSampler sampler =
        job.reader ? isolatedGridSampler(*job.reader, job.readerLimits, job.execution) : sampleGrids;
    v.reading = readAsOutsider(request.vdbPath, file, mesh, fields, sampler, job.execution);
    if (isFlat && file.layers == 0) {  // nothing is promised then, and the report counts the gaps
        v.reading.incomplete = 0;
        v.reading.firstProblem.clear();
    }
    const std::vector<Claim> read = compareReading(mesh, fields, file.report, v.reading);
    v.claims.insert(v.claims.end(), read.begin(), read.end());
    v.times.verifyMs = timer.elapsedMs();
    tellRepair(request.meshPath, v.mesh, job);
    job.say(fmt::format("{} against {}\n", request.vdbPath, request.meshPath) +
            claimsText(v.claims, job.textWidth) + errorText(v.measured, job.textWidth) + voxelsText(v) +
            (v.holds() ? "verified: the file's claims hold\n" : ""));
    return v;
}

Json verifyJson(const VerifyRequest& request, const Verification& v) {
    Json json = documentHead("verify");
    json["mesh_file"] = request.meshPath;
    json["vdb_file"] = request.vdbPath;
    json["holds"] = v.holds();
    json["comparison"] = claimsJson(v.claims);
    json["voxels"] = voxelsJson(v);
    json["coverage"] = coverageJson(v.measured);
    json["error"] = errorJson(v.measured);
    json["stages"] = stagesJson(v.times);
    addRepair(json, v.mesh);
    return json;
}

}  // namespace tessera
