#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/timer.h"
#include "brick/measure_error.h"
#include "check_samples.h"
#include "commands.h"
#include "import_mesh.h"
#include "io/vdb_file.h"
#include "output_paths.h"
#include "registry/registry.h"
#include "report_text.h"

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
        return std::abs(claimed - measured) <= allowed || (std::isnan(claimed) && std::isnan(measured));
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

Json sampleJson(const SampleCheck& check) {
    return {{"points", check.points},
            {"covered", check.covered},
            {"holes", check.holes},
            {"spills", check.spills},
            {"wrong_values", check.wrongValues},
            {"largest_excess", check.largestExcess}};
}

std::string sampleText(const SampleCheck& check) {
    return fmt::format(
        "  {} stored points evaluated directly: {} covered, {} holes, {} spills, {} wrong values\n{}",
        formatCount(check.points), formatCount(check.covered), check.holes, check.spills, check.wrongValues,
        check.firstProblem.empty() ? "" : "  " + check.firstProblem + "\n");
}

}  // namespace

int runVerify(const VerifyArguments& arguments) {
    checkOutputPaths({arguments.meshPath, arguments.vdbPath}, {{"--json", arguments.common.jsonPath}});
    Session session(arguments.common);
    session.progress.declare({{Stage::reading, 1}, {Stage::measuring, 1}, {Stage::comparing, 1}});
    VdbFile file = readVdb(arguments.vdbPath);
    if (file.layout != VdbLayout::levels)
        throw InputError(fmt::format(
            "{}: only files of layout levels hold the exact samples that verify needs", arguments.vdbPath));
    ReadOptions options;
    options.timeStep = arguments.timeStep;
    for (const OutputField& output : file.fields) options.fields.push_back(output.sourceName);
    Timer timer;
    // The same repair as the file's mesh went through: only then do its claims speak of this mesh.
    const std::optional<RepairOptions> repair = decodeRepair(file.repair);
    const ImportedMesh imported = importMesh(arguments.meshPath, options, repair, session);
    const TetMesh& mesh = imported.mesh;
    StageTimes times;
    times.readMs = timer.restart();
    const std::vector<int> fields = matchFields(mesh, file, arguments.meshPath);
    const NearestPointIndex nearest(mesh, session.execution.threadCount());
    MeasureOptions measure;
    measure.boundsWorld = file.boundsWorld;
    const ErrorReport measured =
        measureError(mesh, fields, file.tree, file.store, nearest, session.execution, measure);
    const std::vector<Comparison> rows = compareReports(mesh, fields, file.report, measured, file.halfFloat);
    const SampleCheck samples = checkSamples(mesh, fields, file, namedResampler(file.algorithm),
                                             file.halfFloat, arguments.samples, session.execution);
    times.verifyMs = timer.elapsedMs();
    const bool holds = samples.good() &&
                       std::all_of(rows.begin(), rows.end(), [](const Comparison& r) { return r.holds(); });

    showRepair(arguments.meshPath, imported, repair, session);
    session.print(fmt::format("{} against {}\n", arguments.vdbPath, arguments.meshPath) +
                  comparisonText(rows) + errorText(measured) + sampleText(samples) +
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
                  {"samples", sampleJson(samples)},
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
