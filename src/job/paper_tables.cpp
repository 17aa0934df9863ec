#include "job/paper_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>

#include "compare/run_times.h"
#include "compare/sampling_grid.h"
#include "job/algorithm_list.h"
#include "job/compare_text.h"
#include "job/field_selection.h"
#include "job/import_mesh.h"
#include "job/output_paths.h"
#include "job/paper_figures.h"
#include "job/report_text.h"
#include "mesh/mirror.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"
#include "tessera/lattice.h"
#include "tessera/registry.h"

namespace tessera {

namespace {

/// Whole grids up to this many points are sampled as one box, as the paper did; larger ones in parts.
constexpr std::int64_t kWholeGridPoints = std::int64_t(1) << 24;
constexpr int kPartEdge = 256;
/// Beyond this the paper has figures of its software method alone, and so do we.
constexpr std::int64_t kDeviceGridPoints = std::int64_t(1) << 26;

constexpr const char* kLegend =
    "Published: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the\n"
    "Interactive Visualization of Unstructured Grids, IEEE Visualization 2001, figures\n"
    "9 to 11 (Athlon 900 MHz, GeForce2 GTS; reading slices back not included). Their\n"
    "bluntfin had 220K tetrahedra. Not printed: figure 8, whose heat-sink is not\n"
    "public. WestSingle and WestM/C are their versions of an earlier method, not part\n"
    "of Tessera.\n"
    "Here: seconds, wall clock, median of the runs. Ael: active list and generation of\n"
    "polygons or instances. Rnd: upload and rendering. Back: reading back. ToT:\n"
    "everything, reading back included; stages may overlap, so it can be less than\n"
    "their sum. #Poly: polygons before they are grown; the paper slices along z,\n"
    "Tessera along the axis with the fewest element-slice pairs. Speed-up: over\n"
    "software, here and as published.\n";

/// Where an algorithm has no figures.
constexpr const char* kNone = "-";

using Rows = TableRows;

struct Measured {
    std::string target;
    RunTimes times;
    double aelMs() const { return times.statistics.ms(stage::bin) + times.statistics.ms(stage::generate); }
    double rndMs() const { return times.statistics.ms(stage::upload) + times.statistics.ms(stage::render); }
    /// A resampler without a device has no stages but the list and the rest.
    bool isStaged() const { return times.statistics.count(counted::elementSlicePairs) > 0; }
};

/// Those of one data set.
struct Tables {
    Rows here{{"seconds, here", "Ael", "Rnd", "Back", "ToT", "#Poly", "a pair", "speed-up"}};
    Rows published{{"seconds, published", "Ael", "Rnd", "ToT", "#Poly", "speed-up"}};
};

std::string seconds(double ms) {
    return fmt::format("{:.3f}", ms / 1000);
}
std::string published(const std::optional<double>& value) {
    return value ? fmt::format("{:.2f}", *value) : kNone;
}
std::string ratio(double of, double over) {
    return fmt::format("{:.2f}", of / over);
}

class PaperTables {
  public:
    PaperTables(const PaperTablesRequest& request, Job& job) : request_(request), job_(job) {
        for (const char* name : {"software", "slicing", "hybrid"}) findAlgorithm(name);
    }

    Json run() {
        const MeshFile file = openMesh(request_.mesh, {fieldNames(), -1}, job_);
        field_ = chooseField(file.mesh);
        job_.say(importText(request_.mesh, file.statistics, file.mesh.boundsWorld()) +
                 fmt::format("  field {}, {} threads, median of {} {}\n",
                             file.mesh.fields[std::size_t(field_)].name, job_.execution.threadCount(),
                             request_.runs, request_.runs == 1 ? "run" : "runs"));
        Json sets = Json::array();
        for (const PaperDataSet& set : paperDataSets()) sets.push_back(runSet(set, file.mesh));
        std::string end = "\n";
        end += kLegend;
        for (const auto& [name, reason] : absent_) end += fmt::format("{} is left out: {}\n", name, reason);
        job_.say(end);
        Json json = documentHead("paper-tables");
        json["input"] = request_.mesh;
        json["threads"] = job_.execution.threadCount();
        json["runs"] = request_.runs;
        json["absent"] = absent_;
        json["data_sets"] = std::move(sets);
        return json;
    }

  private:
    /// Algorithms by their names; those that can't run get a reason.
    void findAlgorithm(const std::string& name) {
        for (const Resampler* resampler : resamplers()) {
            const bool isOther = request_.asPublished && resampler->name() == name + "-2001";
            const bool hasOther = request_.asPublished && name != "software";
            if (hasOther ? !isOther : resampler->name() != name) continue;
            const BindOptions options = bindOptionsFor(*resampler, request_.bind);
            const std::string reason = whyNotBound(*resampler, options);
            if (reason.empty())
                algorithms_.push_back({name, resampler, options});
            else
                absent_[name] = reason;
            return;
        }
        absent_[name] = "this build doesn't have it";
    }

    std::vector<std::string> fieldNames() const {
        return request_.field.empty() ? std::vector<std::string>{} : std::vector{request_.field};
    }
    /// The field asked for, or the first scalar one of the points, as the paper resampled.
    int chooseField(const TetMesh& mesh) const {
        if (!request_.field.empty())
            return selectFields(mesh, {{request_.field, request_.field}}).fields.at(0);
        for (std::size_t f = 0; f < mesh.fields.size(); ++f)
            if (mesh.fields[f].components == 1 && mesh.fields[f].location == FieldLocation::point)
                return int(f);
        throw InputError(
            fmt::format("{}: it has no scalar point field; choose one with --field", request_.mesh));
    }

    Json runSet(const PaperDataSet& set, const TetMesh& original) {
        TetMesh mesh = original;
        for (const int axis : set.mirrorAxes)
            mesh = withMirrorImage(mesh, axis, mesh.boundsWorld().min[axis]);
        const std::string name =
            std::string(set.prefix) + std::filesystem::path(request_.mesh).stem().string();
        job_.say(fmt::format("\n{}: {} elements; published in {}: {}K\n", name,
                             formatCount(mesh.elementCount()), set.figures, set.elementsK));
        std::vector<std::unique_ptr<BoundResampler>> bound;
        const std::vector<int> fields{field_};
        for (const Contestant& c : algorithms_) bound.push_back(c.resampler->bind(mesh, fields, c.options));
        Json grids = Json::array();
        Tables tables;
        for (const PaperGrid& grid : set.grids) {
            if (std::max({grid.points.x, grid.points.y, grid.points.z}) > request_.maxSize) continue;
            grids.push_back(runGrid(grid, mesh, bound, tables));
        }
        job_.say(formatTable(tables.here, job_.textWidth) + formatTable(tables.published, job_.textWidth));
        return {{"name", name}, {"elements", mesh.elementCount()}, {"grids", std::move(grids)}};
    }

    Json runGrid(const PaperGrid& grid, const TetMesh& mesh,
                 const std::vector<std::unique_ptr<BoundResampler>>& bound, Tables& tables) {
        const SamplingGrid sampling = spanningGrid(mesh.boundsWorld(), grid.points);
        const bool whole = sampling.points.count() <= kWholeGridPoints;
        const std::vector<IndexBox> boxes =
            whole ? std::vector{sampling.points} : cutIntoBoxes(sampling.points, kPartEdge);
        std::map<std::string, Measured> measured;
        for (std::size_t a = 0; a < bound.size(); ++a) {
            const Contestant& c = algorithms_[a];
            if (!isMeasured(c.label, grid)) continue;
            measured[c.label] = {std::string(bound[a]->target()),
                                 timeRuns(*bound[a], sampling.lattice, boxes, request_.runs,
                                          job_.execution.withoutProgress())};
        }
        addRows(grid, measured, tables);
        return gridJson(grid, measured);
    }

    void addRows(const PaperGrid& grid, const std::map<std::string, Measured>& measured,
                 Tables& tables) const {
        tables.here.push_back({formatGrid(grid.points)});
        tables.published.push_back({formatGrid(grid.points)});
        for (const PaperRow& row : paperRows(grid)) {
            if (!row.algorithm.empty()) tables.here.push_back(ourCells(std::string(row.algorithm), measured));
            if (!row.paperName.empty()) tables.published.push_back(paperCells(row, grid));
        }
    }

    static bool isMeasured(std::string_view algorithm, const PaperGrid& grid) {
        return algorithm == "software" ||
               std::int64_t(grid.points.x) * grid.points.y * grid.points.z <= kDeviceGridPoints;
    }

    /// The published rows, and one without figures for each algorithm that is measured though it has none.
    std::vector<PaperRow> paperRows(const PaperGrid& grid) const {
        std::vector<PaperRow> rows = grid.rows;
        for (const char* name : {"hybrid", "slicing"}) {
            const auto isOf = [&](const auto& item) { return item.algorithm == name; };
            const bool isHere = std::any_of(algorithms_.begin(), algorithms_.end(),
                                            [&](const Contestant& c) { return c.label == name; });
            if (isHere && isMeasured(name, grid) && std::none_of(rows.begin(), rows.end(), isOf))
                rows.insert(rows.begin(), PaperRow{"", name, {}, {}, 0, {}});
        }
        return rows;
    }

    std::vector<std::string> ourCells(const std::string& algorithm,
                                      const std::map<std::string, Measured>& measured) const {
        const auto found = measured.find(algorithm);
        if (found == measured.end())
            return {"  " + algorithm, kNone, kNone, kNone, kNone, kNone, kNone, kNone};
        const Measured& m = found->second;
        const ResampleStatistics& s = m.times.statistics;
        const auto software = measured.find("software");
        const std::string speedUp = software == measured.end() || algorithm == "software"
                                        ? kNone
                                        : ratio(software->second.times.totalMs, m.times.totalMs);
        if (!m.isStaged())
            return {"  " + algorithm,
                    seconds(s.ms(stage::bin)),
                    kNone,
                    kNone,
                    seconds(m.times.totalMs),
                    kNone,
                    kNone,
                    speedUp};
        return {"  " + algorithm,
                seconds(m.aelMs()),
                seconds(m.rndMs()),
                seconds(s.ms(stage::readBack)),
                seconds(m.times.totalMs),
                fmt::format("{:.0f}K", double(s.count(counted::polygons)) / 1000),
                fmt::format("{:.2f}",
                            double(s.count(counted::polygons)) / double(s.count(counted::elementSlicePairs))),
                speedUp};
    }

    static std::vector<std::string> paperCells(const PaperRow& row, const PaperGrid& grid) {
        std::string speedUp = kNone;
        for (const PaperRow& other : grid.rows)
            if (other.algorithm == "software" && row.algorithm != "software")
                speedUp = ratio(other.totSeconds, row.totSeconds);
        return {"  " + std::string(row.paperName),
                published(row.aelSeconds),
                published(row.rndSeconds),
                published(row.totSeconds),
                row.polygonsK ? fmt::format("{}K", *row.polygonsK) : kNone,
                speedUp};
    }

    static Json gridJson(const PaperGrid& grid, const std::map<std::string, Measured>& measured) {
        Json ours = Json::object(), theirs = Json::object();
        for (const auto& [name, m] : measured)
            ours[name] = {
                {"target", m.target},
                {"ael_ms", m.aelMs()},
                {"rnd_ms", m.isStaged() ? Json(m.rndMs()) : Json(nullptr)},
                {"read_back_ms", m.isStaged() ? Json(m.times.statistics.ms(stage::readBack)) : Json(nullptr)},
                {"total_ms", m.times.totalMs},
                {"statistics", statisticsJson(m.times.statistics)}};
        const auto orNull = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
        for (const PaperRow& row : grid.rows)
            theirs[std::string(row.paperName)] = {{"algorithm", row.algorithm},
                                                  {"ael_s", orNull(row.aelSeconds)},
                                                  {"rnd_s", orNull(row.rndSeconds)},
                                                  {"tot_s", row.totSeconds},
                                                  {"polygons_k", orNull(row.polygonsK)}};
        return {{"points", {grid.points.x, grid.points.y, grid.points.z}},
                {"measured", std::move(ours)},
                {"published", std::move(theirs)}};
    }

    const PaperTablesRequest& request_;
    Job& job_;
    std::vector<Contestant> algorithms_;
    std::map<std::string, std::string> absent_;
    int field_ = -1;
};

}  // namespace

Json makePaperTables(const PaperTablesRequest& request, Job& job) {
    checkOutputPaths({request.mesh}, {{"--json", job.reportPath}});
    return PaperTables(request, job).run();
}

}  // namespace tessera
