#include "benchmark/page_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "benchmark/dot_plot.h"
#include "benchmark/page_accuracy.h"
#include "benchmark/page_html.h"
#include "benchmark/page_numbers.h"
#include "files/html_text.h"

namespace tessera {

namespace {

constexpr int kCircle = 0, kSquare = 1, kDiamond = 3;

std::vector<std::string> labelsOf(const DotPlot& plot) {
    std::vector<std::string> labels;
    for (const DotRow& row : plot.rows)
        if (!row.marks.empty()) labels.push_back(row.label);
    return labels;
}

void addPanel(PlotFigure& figure, DotPlot plot) {
    figure.panels.emplace_back(
        [plot = std::move(plot)](const PlotCanvas& canvas) { return drawDotPlot(plot, canvas); });
}

std::string oracleSentence(const PageSource& source) {
    double most = -1, holes = 0, spills = 0;
    for (const Json& o : entriesOf(partOf(source.json(), "oracle", "variants"))) {
        // Methods as published are there to be further off.
        if (source.variant(o).isPeer() || source.variant(o).role == "published") continue;
        most = std::max(most, numberOf(partOf(o, "max")).value_or(-1));
        holes += numberOf(partOf(o, "holes")).value_or(0),
            spills += numberOf(partOf(o, "spills")).value_or(0);
    }
    if (most < 0) return {};
    const auto counted = [](double count) {
        return count == 0 ? std::string("no place") : wholeText(count) + " places";
    };
    const std::string places =
        fmt::format("They miss {} in the mesh and fill {} outside.", counted(holes), counted(spills));
    return fmt::format("Of our algorithms and formats none is further off than {}. {}", percentText(most),
                       places);
}

/// In the page's order.
std::vector<const Json*> oracleEntries(const PageSource& source) {
    std::vector<const Json*> entries;
    for (const PageVariant& v : source.variants())
        for (const Json& o : entriesOf(partOf(source.json(), "oracle", "variants")))
            if (&source.variant(o) == &v && !v.isAgain()) entries.push_back(&o);
    return entries;
}

std::string oracleTable(const PageSource& source) {
    PageTable table{
        "", {{"", PageCell::words}, {"largest error"}, {"99.9 % below"}, {"RMS"}, {"holes"}, {"spills"}}, {}};
    for (const Json* entry : oracleEntries(source)) {
        const Json& o = *entry;
        const auto cell = [&](const char* key, std::string (*text)(double)) {
            const auto value = numberOf(partOf(o, key));
            return value ? text(*value) : std::string();
        };
        table.rows.push_back({source.variant(o).name, cell("max", percentText), cell("p999", percentText),
                              cell("rms", percentText), cell("holes", wholeText), cell("spills", wholeText)});
    }
    return tableHtml(table);
}

/// "128 x 64 x 32" with the sign of multiplication.
std::string gridInWords(const Json& points) {
    std::string text;
    for (const Json& p : entriesOf(points))
        text += (text.empty() ? "" : "\u00d7") + fmt::format("{:.0f}", numberOf(p).value_or(0));
    return text;
}

std::optional<double> softwareMs(const Json& grid) {
    return numberOf(partOf(grid, "measured", "software", "total_ms"));
}

std::optional<double> softwareSeconds(const Json& grid) {
    return numberOf(partOf(grid, "published", "Software", "tot_s"));
}

/// How many times as fast as software, here and in the paper.
std::vector<DotRow> speedUpRows(const PageSource& source, const Json& grid) {
    std::vector<DotRow> rows{{gridInWords(partOf(grid, "points")) + " points", {}, {}, "", true}};
    const std::string points = gridInWords(partOf(grid, "points"));
    const auto rowOf = [&](const std::string& name) -> DotRow& {
        for (DotRow& row : rows)
            if (row.label == name) return row;
        const auto v = std::find_if(source.variants().begin(), source.variants().end(),
                                    [&](const PageVariant& other) { return other.name == name; });
        rows.push_back({name,
                        v == source.variants().end() ? PlotStyle{kInkColour, 0, 0, false, false} : v->style,
                        {},
                        "",
                        false});
        return rows.back();
    };
    const Json& measured = partOf(grid, "measured");
    const Json& published = partOf(grid, "published");
    if (const auto software = softwareMs(grid); software && measured.is_object())
        for (const auto& [name, m] : measured.items())
            if (const auto ms = numberOf(partOf(m, "total_ms"));
                ms && *ms > 0 && *software > 0 && name != "software")
                rowOf(name).marks.push_back({*software / *ms, 0, 0, kCircle, false,
                                             fmt::format("{}, {}, here: {}, software {}", name, points,
                                                         timeText(*ms), timeText(*software)),
                                             speedText(*software / *ms)});
    if (const auto software = softwareSeconds(grid); software && published.is_object())
        for (const auto& [name, p] : published.items()) {
            const auto seconds = numberOf(partOf(p, "tot_s"));
            const std::string algorithm = wordsOf(partOf(p, "algorithm"));
            if (!seconds || *seconds <= 0 || *software <= 0 || algorithm == "software") continue;
            rowOf(algorithm.empty() ? name : algorithm)
                .marks.push_back({*software / *seconds, 0, 0, kDiamond, true,
                                  fmt::format("{}, {}, published: {}, software {}", name, points,
                                              timeText(*seconds * 1e3), timeText(*software * 1e3)),
                                  speedText(*software / *seconds)});
        }
    return rows.size() > 1 ? rows : std::vector<DotRow>();
}

std::string secondsCell(const Json& json) {
    const auto seconds = numberOf(json);
    return seconds ? timeText(*seconds * 1e3) : "";
}

std::string msCell(const Json& json) {
    const auto ms = numberOf(json);
    return ms ? timeText(*ms) : "";
}

PageTable paperStagesTable(const Json& set) {
    const auto elements = numberOf(partOf(set, "elements")),
               publishedK = numberOf(partOf(set, "published_elements_k"));
    std::string caption = wordsOf(partOf(set, "name"));
    if (elements) caption += fmt::format(", {} elements", wholeText(*elements));
    if (publishedK) caption += fmt::format(" (in the paper {})", wholeText(*publishedK * 1e3));
    if (const std::string figures = wordsOf(partOf(set, "figures")); !figures.empty())
        caption += "; " + figures;
    PageTable table{caption,
                    {{"grid", PageCell::words},
                     {"", PageCell::words},
                     {"", PageCell::words},
                     {"active elements"},
                     {"drawing"},
                     {"read back"},
                     {"whole"},
                     {"polygons"}},
                    {}};
    for (const Json& grid : entriesOf(partOf(set, "grids"))) {
        std::string points = gridInWords(partOf(grid, "points"));
        const auto add = [&](std::vector<std::string> row) {
            row.insert(row.begin(), points);
            table.rows.push_back(std::move(row));
        };
        if (partOf(grid, "measured").is_object())
            for (const auto& [name, m] : partOf(grid, "measured").items()) {
                const auto polygons = numberOf(partOf(m, "polygons"));
                add({"here", name, msCell(partOf(m, "ael_ms")), msCell(partOf(m, "rnd_ms")),
                     msCell(partOf(m, "read_back_ms")), msCell(partOf(m, "total_ms")),
                     polygons ? wholeText(*polygons) : ""});
            }
        if (partOf(grid, "published").is_object())
            for (const auto& [name, p] : partOf(grid, "published").items()) {
                const auto polygons = numberOf(partOf(p, "polygons_k"));
                const std::string algorithm = wordsOf(partOf(p, "algorithm"));
                add({"published", algorithm.empty() ? name : name + ", our " + algorithm,
                     secondsCell(partOf(p, "ael_s")), secondsCell(partOf(p, "rnd_s")), "",
                     secondsCell(partOf(p, "tot_s")), polygons ? wholeText(*polygons * 1e3) : ""});
            }
    }
    return table;
}

/// The whole times here and in the paper, of those that do the same.
PageTable paperTable(const Json& set) {
    PageTable table{wordsOf(partOf(set, "name")),
                    {{"grid", PageCell::words},
                     {"", PageCell::words},
                     {"here"},
                     {"over software"},
                     {"in the paper", PageCell::words},
                     {"published"},
                     {"over software"}},
                    {}};
    const auto speedUp = [](std::optional<double> software, std::optional<double> time) {
        return software && time && *time > 0 ? speedText(*software / *time) : std::string();
    };
    for (const Json& grid : entriesOf(partOf(set, "grids"))) {
        const Json& measured = partOf(grid, "measured");
        const Json& published = partOf(grid, "published");
        const auto rowOf = [&](const std::string& name, const std::string& paperName, const Json& p) {
            const auto ms = numberOf(partOf(measured, name, "total_ms")),
                       seconds = numberOf(partOf(p, "tot_s"));
            table.rows.push_back({gridInWords(partOf(grid, "points")), name, ms ? timeText(*ms) : "",
                                  speedUp(softwareMs(grid), ms), paperName, secondsCell(partOf(p, "tot_s")),
                                  speedUp(softwareSeconds(grid), seconds)});
        };
        std::vector<std::string> paired;
        if (published.is_object())
            for (const auto& [paperName, p] : published.items()) {
                paired.push_back(wordsOf(partOf(p, "algorithm")));
                rowOf(paired.back(), paperName, p);
            }
        if (measured.is_object())
            for (const auto& [name, m] : measured.items())
                if (std::find(paired.begin(), paired.end(), name) == paired.end()) rowOf(name, "", {});
    }
    return table;
}

/// Terms and what they are, those that are there.
class FactList {
  public:
    void add(const char* term, const std::string& words) {
        if (!words.empty()) facts_.push_back(fmt::format("<dt>{}</dt><dd>{}</dd>\n", term, inHtml(words)));
    }
    std::string html() const {
        std::string all;
        for (const std::string& fact : facts_) all += fact;
        return all.empty() ? "" : "<dl>\n" + all + "</dl>\n";
    }

  private:
    std::vector<std::string> facts_;
};

std::string openGlInWords(const Json& gl) {
    std::string text = wordsOf(partOf(gl, "renderer"));
    for (const char* const key : {"vendor", "version", "platform"})
        if (const std::string words = wordsOf(partOf(gl, key)); !words.empty())
            text += (text.empty() ? "" : "; ") + words;
    if (!text.empty() && isTrue(partOf(gl, "emulated")))
        text += " (emulated on the processor: no graphics card)";
    return text;
}

std::string factsHtml(const PageSource& source) {
    const Json& document = source.json();
    const Json& machine = partOf(document, "machine");
    FactList facts;
    facts.add("processor", wordsOf(partOf(machine, "processor")));
    if (const auto threads = numberOf(partOf(machine, "threads"))) facts.add("threads", wholeText(*threads));
    if (const auto bytes = numberOf(partOf(machine, "memory_bytes"))) facts.add("memory", bytesText(*bytes));
    facts.add("system", wordsOf(partOf(machine, "system")));
    facts.add("OpenGL", openGlInWords(partOf(machine, "opengl")));
    std::string compiler = wordsOf(partOf(machine, "compiler"));
    if (const std::string build = wordsOf(partOf(machine, "build")); !build.empty())
        compiler += (compiler.empty() ? "" : ", ") + build;
    facts.add("compiler", compiler);
    facts.add("tessera", wordsOf(partOf(document, "tessera")));
    facts.add("commit", wordsOf(partOf(machine, "commit")));
    facts.add("date", wordsOf(partOf(machine, "date")));
    std::string notes;
    for (const PageVariant& v : source.variants())
        if (v.isPeer()) notes += (notes.empty() ? "" : "; ") + v.name + (v.note.empty() ? "" : ": " + v.note);
    facts.add("other programs", notes);
    return facts.html();
}

std::string settingsSentence(const Json& settings) {
    std::string text;
    if (const auto rounds = numberOf(partOf(settings, "rounds"))) {
        text =
            fmt::format("Everything was timed in {} rounds, after a first run of each", wholeText(*rounds));
        if (const auto seconds = numberOf(partOf(settings, "seconds")))
            text += fmt::format(", {} in all", *seconds >= 120
                                                   ? threeDigits(*seconds / 60) + kThinSpace + "minutes"
                                                   : timeText(*seconds * 1e3));
        text += ".";
    }
    text +=
        " Each round takes all variants in another random order, so that what else the machine does meets "
        "all alike. "
        "Times are medians; their intervals hold the true median in 95 of 100 cases where there are six "
        "rounds or more.";
    if (isTrue(partOf(settings, "quick"))) text += " This was a quick run: fewer rounds and cases.";
    if (const auto seed = numberOf(partOf(settings, "seed")))
        text += fmt::format(" The order comes from seed {}.", wholeText(*seed));
    return text;
}

std::string noiseSentence(const PageSource& source) {
    int agree = 0, known = 0;
    for (const Json& a : entriesOf(partOf(source.json(), "again"))) {
        if (!partOf(a, "agrees").is_boolean()) continue;
        ++known, agree += isTrue(partOf(a, "agrees"));
    }
    return known == 0
               ? ""
               : fmt::format("One variant was timed as two, which should be alike: {} of {} pairs agree.",
                             agree, known);
}

std::string runsTable(const PageSource& source) {
    PageTable table{"",
                    {{"", PageCell::words},
                     {"grid", PageCell::words},
                     {"asked", PageCell::words},
                     {"levels"},
                     {"voxels"},
                     {"in the mesh"},
                     {"time", PageCell::time},
                     {"95 % interval"},
                     {"processors"},
                     {"memory"},
                     {"largest error"},
                     {"99.9 % below"},
                     {"RMS"},
                     {"picture RMS"}},
                    {}};
    for (const PageRun& run : source.runs()) {
        const auto cell = [&](const char* key, std::string (*text)(double)) {
            const auto value = numberOf(partOf(*run.json, key));
            return value ? text(*value) : std::string();
        };
        const auto errorCell = [&](const char* measure) {
            const auto value = run.error(measure);
            return value ? percentText(*value) : std::string();
        };
        table.rows.push_back({run.variant->name, criterionInWords(run.criterion), run.asked,
                              cell("levels", wholeText), cell("voxels", wholeText),
                              cell("covered", wholeText), run.time ? timeText(run.time->median) : "",
                              run.time ? rangeText(*run.time) : "", cell("processor_ms", timeText),
                              cell("peak_memory_bytes", bytesText), errorCell("max"), errorCell("p999"),
                              errorCell("rms"), run.pictureRms ? threeDigits(*run.pictureRms) : ""});
    }
    return tableHtml(table);
}

}  // namespace

PlotFigure oracleFigure(const PageSource& source) {
    PlotFigure figure{"The algorithms' own errors", {}, {}};
    DotPlot plot{
        "",
        {"error, share of the field's range; further left is closer", AxisUnit::share, false, false, {}, {}},
        {},
        {{kCircle, false, "largest"}, {kDiamond, true, "99.9 % below"}, {kSquare, false, "RMS"}},
        {}};
    struct Measure {
        const char *key, *words;
        int shape;
        bool isHollow;
    };
    bool isEmpty = true;
    for (const Json* o : oracleEntries(source)) {
        const PageVariant& v = source.variant(*o);
        DotRow row{v.name, v.style, {}, "", false};
        for (const Measure& m :
             {Measure{"rms", "RMS", kSquare, false}, Measure{"p999", "99.9 % below", kDiamond, true},
              Measure{"max", "largest", kCircle, false}})
            if (const auto error = numberOf(partOf(*o, m.key)))
                row.marks.push_back({*error, 0, 0, m.shape, m.isHollow,
                                     fmt::format("{}, {}: {}", v.name, m.words, percentText(*error)), ""});
        if (row.marks.empty()) row.note = "not measured";
        isEmpty = isEmpty && row.marks.empty();
        plot.rows.push_back(std::move(row));
    }
    if (isEmpty) return figure;
    figure.note = source.missingPeers(labelsOf(plot));
    addPanel(figure, std::move(plot));
    return figure;
}

std::string exactnessSection(const PageSource& source) {
    const std::string oracle = figureHtml(oracleFigure(source)), picture = figureHtml(pictureFigure(source));
    std::string html;
    if (!oracle.empty()) {
        std::string how = "How far each algorithm's voxels are from what the mesh has there";
        const auto places = numberOf(partOf(source.json(), "oracle", "places")),
                   lattices = numberOf(partOf(source.json(), "oracle", "lattices"));
        if (places)
            how += fmt::format(", at {} places{}", wholeText(*places),
                               lattices ? fmt::format(" of {} grids", wholeText(*lattices)) : "");
        html +=
            paragraphHtml(
                how +
                ". What is exact comes from arithmetic without rounding. A hole is a place in the mesh that "
                "is left empty, "
                "a spill a place outside that is filled. No error at all stands in the lane at the left.") +
            paragraphHtml(oracleSentence(source), "says") + besideHtml(oracle, oracleTable(source));
    }
    if (!picture.empty())
        html += "<h3>In pictures</h3>\n" +
                paragraphHtml(
                    "Pictures drawn from the voxels, compared with pictures drawn from the mesh itself. One "
                    "step is the least that a screen shows.") +
                picture;
    return sectionHtml("exactness", "Exactness", html);
}

PlotFigure paperFigure(const PageSource& source) {
    PlotFigure figure{"Speed over software, here and as published", {}, {}};
    std::vector<std::string> present;
    std::vector<DotPlot> plots;
    AxisRange range;
    for (const Json& set : entriesOf(partOf(source.json(), "paper", "data_sets"))) {
        DotPlot plot{
            wordsOf(partOf(set, "name")),
            {"times as fast as software; further right is faster", AxisUnit::times, false, false, {}, {}},
            {},
            {{kCircle, false, "here"}, {kDiamond, true, "published"}},
            1.0};
        for (const Json& grid : entriesOf(partOf(set, "grids"))) {
            for (DotRow& row : speedUpRows(source, grid)) plot.rows.push_back(std::move(row));
            if (partOf(grid, "measured").is_object())
                for (const auto& [name, m] : partOf(grid, "measured").items()) present.push_back(name);
        }
        for (const DotRow& row : plot.rows)
            for (const DotMark& mark : row.marks) range.include(mark.value);
        if (!plot.rows.empty()) plots.push_back(std::move(plot));
    }
    for (DotPlot& plot : plots) {
        plot.x.range = range;
        addPanel(figure, std::move(plot));
    }
    if (!figure.panels.empty()) figure.note = source.missingPeers(present);
    return figure;
}

std::string paperSection(const PageSource& source) {
    const std::string figure = figureHtml(paperFigure(source));
    std::string tables, stages;
    for (const Json& set : entriesOf(partOf(source.json(), "paper", "data_sets")))
        tables += tableHtml(paperTable(set)), stages += tableHtml(paperStagesTable(set));
    if (figure.empty() && tables.empty()) return {};
    return sectionHtml(
        "paper", "Beside the paper's tables",
        paragraphHtml(
            "The grids of the paper that the algorithms come from. The machines are decades apart, so "
            "compare each with "
            "software on the same machine: to the right of the dashed line it is faster than that.") +
            figure + tables +
            detailsHtml("All stages of all of them",
                        paragraphHtml(wordsOf(partOf(source.json(), "paper", "legend")), "soft") + stages));
}

PlotFigure noiseFigure(const PageSource& source) {
    PlotFigure figure{"A variant timed as two", {}, {}};
    DotPlot plot{"",
                 {"time of the second over the first; alike at 1", AxisUnit::times, false, true, {}, {}},
                 {},
                 {},
                 1.0};
    for (const Json& a : entriesOf(partOf(source.json(), "again"))) {
        const auto ratio = pageTimeOf(partOf(a, "ratio"));
        if (!ratio) continue;
        const std::string asked = wordsOf(partOf(a, "asked"));
        const bool agrees = !partOf(a, "agrees").is_boolean() || isTrue(partOf(a, "agrees"));
        plot.rows.push_back({asked,
                             {agrees ? 0 : 1, 0, 0, false, false},
                             {{ratio->median, ratio->low, ratio->high, agrees ? kCircle : kDiamond, !agrees,
                               fmt::format("{}: {} ({} to {})", asked, threeDigits(ratio->median),
                                           threeDigits(ratio->low), threeDigits(ratio->high)),
                               threeDigits(ratio->median)}},
                             agrees ? "" : "differs",
                             false});
    }
    if (plot.rows.empty()) return figure;
    if (const std::vector<std::string> peers = source.peers(); !peers.empty())
        figure.note = fmt::format("Timed once only: {}.", listInWords(peers));
    addPanel(figure, std::move(plot));
    return figure;
}

std::string comparisonSection(const PageSource& source) {
    const Json& compared = partOf(source.json(), "compared");
    std::vector<std::string> sentences;
    for (const Json& sentence : entriesOf(partOf(compared, "sentences")))
        if (const std::string words = wordsOf(sentence); !words.empty()) sentences.push_back(words);
    if (sentences.empty()) return {};
    PageTable table{"Time over that of the earlier run",
                    {{"", PageCell::words}, {"cases"}, {"median"}, {"95 % interval"}, {"", PageCell::words}},
                    {}};
    for (const Json& row : entriesOf(partOf(compared, "algorithms")))
        if (const auto ratio = pageTimeOf(partOf(row, "ratio")))
            table.rows.push_back({wordsOf(partOf(row, "algorithm")), wholeText(ratio->count),
                                  fmt::format("{:.3g}", ratio->median),
                                  fmt::format("{:.3g} to {:.3g}", ratio->low, ratio->high),
                                  wordsOf(partOf(row, "verdict"))});
    return sectionHtml("compared", "Since the earlier run", listHtml(sentences, "says") + tableHtml(table));
}

std::string methodSection(const PageSource& source) {
    const Json& document = source.json();
    const std::string facts = factsHtml(source), noise = figureHtml(noiseFigure(source)),
                      runs = runsTable(source);
    std::vector<std::string> absent;
    for (const Json& sentence : entriesOf(partOf(document, "absent")))
        if (const std::string words = wordsOf(sentence); !words.empty()) absent.push_back(words);
    if (facts.empty() && noise.empty() && runs.empty() && absent.empty()) return {};
    std::string html;
    if (!source.runs().empty()) html += paragraphHtml(settingsSentence(partOf(document, "settings")));
    if (!noise.empty())
        html += "<h3>How much is noise</h3>\n" + paragraphHtml(noiseSentence(source), "says") +
                paragraphHtml(
                    "Intervals that hold 1 can't tell the two apart. Differences between variants that are "
                    "no larger than these mean nothing.") +
                noise;
    if (!absent.empty()) html += "<h3>What is absent here</h3>\n" + listHtml(absent);
    if (!facts.empty()) html += "<h3>Machine and versions</h3>\n" + facts;
    html += detailsHtml(fmt::format("All {} runs", source.runs().size()), runs);
    return sectionHtml("method", "How it was measured", html);
}

}  // namespace tessera
