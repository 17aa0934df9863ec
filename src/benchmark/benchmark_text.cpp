#include "benchmark/benchmark_text.h"

#include <fmt/format.h>

#include "job/report_text.h"
#include "job/wrap_text.h"

namespace tessera {

namespace {

constexpr const char* kNone = "-";

std::string msText(const Json& value) {
    return value.is_number() ? fmt::format("{:.3g}", value.get<double>()) : kNone;
}

/// "12.3 (11.9 to 13)"
std::string intervalText(const Json& ms) {
    if (!ms.is_object()) return kNone;
    return fmt::format("{} ({} to {})", msText(ms["median"]), msText(ms["low"]), msText(ms["high"]));
}

std::string percent(const Json& value) {
    return value.is_number() ? fmt::format("{:.3g} %", 100 * value.get<double>()) : kNone;
}

std::string megabytes(const Json& value) {
    return value.is_number() ? formatBytes(value.get<std::int64_t>()) : kNone;
}

std::string equalErrorText(const Json& document, std::size_t width) {
    std::string text;
    for (const char* measure : {"max", "rms"}) {
        TableRows rows{{measure == std::string("max") ? "ms to a largest error of" : "ms to an RMS error of",
                        "bricks", "10 %", "5 %", "2 %", "1 %"}};
        for (const Json& entry : document["equal_error"]) {
            if (entry["measure"] != measure) continue;
            const std::string variant = entry["variant"], criterion = entry["criterion"];
            std::size_t at = 1;
            while (at < rows.size() && (rows[at][0] != variant || rows[at][1] != criterion)) ++at;
            if (at == rows.size()) rows.push_back({variant, criterion, kNone, kNone, kNone, kNone});
            const double bound = entry["bound"];
            const std::size_t column = bound == 0.1 ? 2 : bound == 0.05 ? 3 : bound == 0.02 ? 4 : 5;
            rows[at][column] =
                entry["ms"].is_object() ? msText(entry["ms"]["median"]) : entry["how"].get<std::string>();
        }
        if (rows.size() > 1) text += formatTable(rows, width, {.keys = 2}) + "\n";
    }
    return text;
}

std::string runsText(const Json& document, std::size_t width) {
    TableRows rows{{"variant", "bricks", "ms", "voxels", "largest", "RMS"}};
    TableRows more{{"variant", "bricks", "picture's RMS, of 255", "memory of the whole program"}};
    for (const Json& run : document["runs"]) {
        const std::string criterion = run["criterion"], asked = run["asked"];
        const std::string bricks =
            criterion == "error" || criterion == "focus" ? asked : criterion + ", " + asked;
        rows.push_back({run["variant"], bricks, intervalText(run["ms"]),
                        formatCount(run["voxels"].get<std::int64_t>()), percent(run["error"]["max"]),
                        percent(run["error"]["rms"])});
        if (run["picture_rms"].is_number() || run["peak_memory_bytes"].is_number())
            more.push_back(
                {run["variant"], bricks, msText(run["picture_rms"]), megabytes(run["peak_memory_bytes"])});
    }
    return formatTable(rows, width, {.keys = 2}) +
           (more.size() > 1 ? "\n" + formatTable(more, width, {.keys = 2}) : "");
}

std::string scalingText(const Json& document, std::size_t width) {
    std::string text;
    for (const char* kind : {"resolution", "elements"}) {
        TableRows rows{{fmt::format("time grows with {} to the power of", kind), "exponent", "from", "to"}};
        for (const Json& fit : document["scaling"][kind])
            if (fit["exponent"].is_object())
                rows.push_back({fit["variant"], msText(fit["exponent"]["value"]),
                                msText(fit["exponent"]["low"]), msText(fit["exponent"]["high"])});
        if (rows.size() > 1) text += formatTable(rows, width) + "\n";
    }
    return text;
}

std::string stagesText(const Json& document, std::size_t width) {
    std::vector<std::string> names;
    double finest = 0;
    for (const Json& run : document["runs"]) {
        if (run["criterion"] != "uniform") continue;
        finest = std::max(finest, run["resolution"].get<double>());
        for (const auto& [name, ms] : run["stages_ms"].items())
            if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
    TableRows rows{{"stages, ms", "asked", "all"}};
    rows[0].insert(rows[0].end(), names.begin(), names.end());
    for (const Json& run : document["runs"]) {
        if (run["criterion"] != "uniform" || run["resolution"] != finest) continue;
        std::vector<std::string> row{run["variant"], run["asked"], msText(run["ms"]["median"])};
        for (const std::string& name : names)
            row.push_back(run["stages_ms"].contains(name) ? msText(run["stages_ms"][name]) : kNone);
        rows.push_back(std::move(row));
    }
    return rows.size() > 1 ? formatTable(rows, width, {.keys = 2}) : std::string();
}

std::string oracleText(const Json& document, std::size_t width) {
    TableRows rows{{"against exact arithmetic, of the range", "largest", "99.9 %", "RMS", "holes", "spills"}};
    for (const Json& v : document["oracle"]["variants"])
        rows.push_back({v["variant"], percent(v["max"]), percent(v["p999"]), percent(v["rms"]),
                        formatCount(v["holes"].get<std::int64_t>()),
                        formatCount(v["spills"].get<std::int64_t>())});
    return formatTable(rows, width);
}

std::string rooflineText(const Json& document, std::size_t width) {
    std::string text;
    for (const Json& m : document["roofline"]["machine"])
        text += fmt::format(
            "{} threads: fill {:.3g} GB/s, copy {:.3g} GB/s, first touch {:.3g} GB/s (large pages {:.3g})\n",
            m["threads"].get<int>(), m["fill_gb_s"].get<double>(), m["copy_gb_s"].get<double>(),
            m["first_touch_gb_s"].get<double>(), m["first_touch_large_pages_gb_s"].get<double>());
    TableRows rows{{"against the least that memory needs", "points", "ms", "least", "times"}};
    for (const Json& run : document["roofline"]["runs"])
        rows.push_back({run["variant"], msText(run["resolution"]), msText(run["ms"]), msText(run["least_ms"]),
                        msText(run["times_least"])});
    return text + formatTable(rows, width);
}

std::string warmText(const Json& document, std::size_t width) {
    TableRows rows{{"bound already, ms", "points", "to", "ms", "on the device", "processor", "uploaded",
                    "pairs", "ns a pair"}};
    for (const Json& w : document["warm"])
        rows.push_back({w["variant"], w["case"], w["to"], intervalText(w["ms"]), msText(w["render_ms"]),
                        msText(w["processor_ms"]), megabytes(w["upload_bytes"]),
                        formatCount(w["pairs"].get<std::int64_t>()), msText(w["ns_a_pair"])});
    return rows.size() > 1 ? formatTable(rows, width, {.keys = 3}) : std::string();
}

std::string paperText(const Json& document, std::size_t width) {
    const Json& paper = document["paper"];
    if (!paper.contains("data_sets") || paper["data_sets"].empty()) return {};
    std::string text;
    const auto seconds = [](const Json& value, double unit) {
        return value.is_number() ? fmt::format("{:.3f}", value.get<double>() * unit) : std::string(kNone);
    };
    for (const Json& set : paper["data_sets"]) {
        text += fmt::format("{}: {} elements; published in {}: {}K\n", set["name"].get<std::string>(),
                            formatCount(set["elements"].get<std::int64_t>()),
                            set["figures"].get<std::string>(), set["published_elements_k"].get<int>());
        TableRows rows{{"seconds", "", "Ael", "Rnd", "Back", "ToT", "polygons"}};
        for (const Json& grid : set["grids"]) {
            const std::string points =
                fmt::format("{} x {} x {}", grid["points"][0].get<int>(), grid["points"][1].get<int>(),
                            grid["points"][2].get<int>());
            for (const auto& [name, m] : grid["measured"].items())
                rows.push_back({points, name, seconds(m["ael_ms"], 1e-3), seconds(m["rnd_ms"], 1e-3),
                                seconds(m["read_back_ms"], 1e-3), seconds(m["total_ms"], 1e-3),
                                m["polygons"].is_number()
                                    ? fmt::format("{:.0f}K", m["polygons"].get<double>() / 1000)
                                    : kNone});
            for (const auto& [name, p] : grid["published"].items())
                rows.push_back(
                    {points, name + " (2001)", seconds(p["ael_s"], 1), seconds(p["rnd_s"], 1), kNone,
                     seconds(p["tot_s"], 1),
                     p["polygons_k"].is_number() ? fmt::format("{}K", p["polygons_k"].get<int>()) : kNone});
        }
        text += formatTable(rows, width, {.keys = 2}) + "\n";
    }
    return text + wrapLine(paper["legend"].get<std::string>(), width, 0) + "\n";
}

std::string againText(const Json& document, std::size_t width) {
    TableRows rows{{"the same twice", "asked", "ratio", "holds 1"}};
    for (const Json& pair : document["again"])
        rows.push_back({pair["variant"], pair["asked"], intervalText(pair["ratio"]),
                        pair["agrees"].get<bool>() ? "yes" : "no"});
    return rows.size() > 1 ? formatTable(rows, width, {.keys = 2}) : std::string();
}

std::string comparedText(const Json& document, std::size_t width) {
    if (!document.contains("compared")) return {};
    std::string text;
    for (const Json& sentence : document["compared"]["sentences"])
        text += wrapLine(sentence.get<std::string>(), width, 0) + "\n";
    return text;
}

}  // namespace

std::string benchmarkText(const Json& document, std::size_t width) {
    std::string text;
    for (const std::string& part :
         {runsText(document, width), equalErrorText(document, width), scalingText(document, width),
          stagesText(document, width), oracleText(document, width), rooflineText(document, width),
          warmText(document, width), paperText(document, width), againText(document, width)})
        if (!part.empty()) text += "\n" + part;
    text += "\n";
    for (const Json& sentence : document["absent"])
        text += wrapLine("Left out: " + sentence.get<std::string>(), width, 2) + "\n";
    for (const Json& sentence : document["advice"])
        text += wrapLine(sentence.get<std::string>(), width, 0) + "\n";
    return withoutControls(text + comparedText(document, width));
}

}  // namespace tessera
