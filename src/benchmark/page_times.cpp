#include "benchmark/page_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "benchmark/dot_plot.h"
#include "benchmark/page_html.h"
#include "benchmark/page_numbers.h"
#include "benchmark/xy_plot.h"

namespace tessera {

namespace {

constexpr int kNamelessPart = kBarKinds - 1;

/// ms = factor * x^exponent, as fitted.
struct Growth {
    const PageVariant* variant = nullptr;
    std::optional<double> exponent, low, high, factorMs;
    std::vector<std::pair<double, PageTime>> points;
};

std::vector<Growth> growthsOf(const PageSource& source, const std::string& axis) {
    std::vector<Growth> all;
    for (const Json& entry : entriesOf(partOf(source.json(), "scaling", axis))) {
        Growth growth{&source.variant(entry),
                      numberOf(partOf(entry, "exponent", "value")),
                      numberOf(partOf(entry, "exponent", "low")),
                      numberOf(partOf(entry, "exponent", "high")),
                      numberOf(partOf(entry, "factor_ms")),
                      {}};
        for (const Json& point : entriesOf(partOf(entry, "points")))
            if (const auto x = numberOf(partOf(point, "x")); x && *x > 0)
                if (const auto time = pageTimeOf(partOf(point, "ms"))) growth.points.emplace_back(*x, *time);
        if (!growth.variant->isAgain()) all.push_back(std::move(growth));
    }
    // Variants of one role stay in the page's order.
    std::stable_sort(all.begin(), all.end(),
                     [](const Growth& a, const Growth& b) { return a.variant < b.variant; });
    return all;
}

XySeries growthSeries(const Growth& growth, const std::string& unit) {
    const PageVariant& v = *growth.variant;
    XySeries series{v.name, v.name, v.style, {}, true, {}};
    if (growth.exponent) series.label = fmt::format("{} ({:.2f})", v.name, *growth.exponent);
    double least = INFINITY, most = 0;
    for (const auto& [x, time] : growth.points) {
        series.points.push_back({x, time.median, time.low, time.high,
                                 fmt::format("{}, {} {}: {}", v.name, wholeText(x), unit, intervalText(time)),
                                 0});
        least = std::min(least, x), most = std::max(most, x);
    }
    if (growth.exponent && growth.factorMs && most > least)
        for (const double x : {least, most})
            series.fit.push_back({x, *growth.factorMs * std::pow(x, *growth.exponent)});
    return series;
}

/// Uniform runs of what has no fit.
void addUnfitted(const PageSource& source, XyPlot& plot) {
    for (const PageVariant& v : source.variants()) {
        const bool isThere = std::any_of(plot.series.begin(), plot.series.end(),
                                         [&](const XySeries& s) { return s.shortLabel == v.name; });
        if (isThere || v.isAgain()) continue;
        XySeries series{v.name, v.name, v.style, {}, true, {}};
        for (const PageRun& run : source.runs())
            if (run.variant == &v && run.isUniform() && run.resolution && run.time)
                series.points.push_back(
                    {*run.resolution, run.time->median, run.time->low, run.time->high,
                     fmt::format("{}, {}: {}", v.name, run.asked, intervalText(*run.time)), 0});
        if (!series.points.empty()) plot.series.push_back(std::move(series));
    }
}

std::vector<double> askedResolutions(const PageSource& source) {
    std::set<double> asked;
    for (const PageRun& run : source.runs())
        if (run.isUniform() && run.resolution) asked.insert(*run.resolution);
    return {asked.begin(), asked.end()};
}

std::string growthSentence(const std::vector<Growth>& all, const std::string& what) {
    const Growth *least = nullptr, *most = nullptr;
    for (const Growth& growth : all) {
        if (!growth.exponent) continue;
        if (!least || *growth.exponent < *least->exponent) least = &growth;
        if (!most || *growth.exponent > *most->exponent) most = &growth;
    }
    if (!least) return {};
    const auto factor = [](const Growth& growth) { return timesText(std::pow(2, *growth.exponent)); };
    if (least == most)
        return fmt::format("Twice the {} take {} {} as long.", what, least->variant->name, factor(*least));
    return fmt::format("Twice the {} take {} as long with {}, and {} with {}.", what, factor(*least),
                       least->variant->name, factor(*most), most->variant->name);
}

std::string growthTable(const std::vector<Growth>& all, const std::string& twice) {
    PageTable table{"", {{"", PageCell::words}, {"power"}, {"95 % interval"}, {twice}}, {}};
    for (const Growth& g : all) {
        if (!g.exponent) continue;
        const std::string interval = g.low && g.high ? fmt::format("{:.2f} to {:.2f}", *g.low, *g.high) : "";
        table.rows.push_back({g.variant->name, fmt::format("{:.2f}", *g.exponent), interval,
                              timesText(std::pow(2, *g.exponent)) + " as long"});
    }
    return tableHtml(table);
}

/// The largest resolution that all have that are always shown; the most common one where there is none.
std::optional<double> commonResolution(const PageSource& source) {
    std::optional<double> best;
    std::size_t mostVariants = 0;
    for (const double resolution : askedResolutions(source)) {
        std::set<const PageVariant*> having;
        for (const PageRun& run : source.runs())
            if (run.isUniform() && run.resolution == resolution &&
                partOf(*run.json, "stages_ms").is_object() && !run.variant->isVariation() &&
                !run.variant->isAgain())
                having.insert(run.variant);
        if (!having.empty() && having.size() >= mostVariants) mostVariants = having.size(), best = resolution;
    }
    return best;
}

std::string stageInWords(std::string name) {
    std::replace(name.begin(), name.end(), '_', ' ');
    return name == "all" ? "not told apart" : name;
}

/// Gives each stage a colour, in the order in which they come.
class StageKinds {
  public:
    int kindOf(const std::string& words) {
        if (words == "other" || words == "not told apart") return kNamelessPart;
        const auto found = std::find(names_.begin(), names_.end(), words);
        const int kind = int(found - names_.begin());
        if (found == names_.end()) names_.push_back(words);
        return kind % kNamelessPart;
    }
    std::vector<std::pair<int, std::string>> key() const {
        std::vector<std::pair<int, std::string>> key;
        for (std::size_t i = 0; i < names_.size(); ++i) key.emplace_back(int(i) % kNamelessPart, names_[i]);
        key.emplace_back(kNamelessPart, "the rest, or not told apart");
        return key;
    }

  private:
    std::vector<std::string> names_;
};

BarRow stageRow(const PageRun& run, StageKinds& kinds) {
    BarRow row{run.variant->name, timeText(run.time->median), run.variant->style, {}};
    double sum = 0;
    const auto add = [&](const std::string& words, double ms) {
        if (ms <= 0) return;
        sum += ms;
        row.parts.push_back(
            {ms, kinds.kindOf(words), fmt::format("{}, {}: {}", run.variant->name, words, timeText(ms))});
    };
    for (const auto& [name, value] : partOf(*run.json, "stages_ms").items())
        if (const auto ms = numberOf(value)) add(stageInWords(name), *ms);
    if (const double rest = run.time->median - sum; rest > 0.01 * run.time->median) add("other", rest);
    return row;
}

/// One run a variant, in the page's order.
std::vector<const PageRun*> runsAt(const PageSource& source, double resolution) {
    std::vector<const PageRun*> found;
    for (const PageVariant& v : source.variants()) {
        if (v.isAgain()) continue;
        const auto run = std::find_if(source.runs().begin(), source.runs().end(), [&](const PageRun& r) {
            return r.variant == &v && r.isUniform() && r.resolution == resolution && r.time;
        });
        if (run != source.runs().end() && partOf(*run->json, "stages_ms").is_object()) found.push_back(&*run);
    }
    return found;
}

std::string stagesSentence(const PageSource& source, double resolution) {
    std::vector<std::string> parts;
    for (const PageRun* run : runsAt(source, resolution)) {
        if (run->variant->role != "main" || run->time->median <= 0) continue;
        std::string longest;
        double most = 0;
        for (const auto& [name, value] : partOf(*run->json, "stages_ms").items())
            if (const auto ms = numberOf(value); ms && *ms > most && name != "other" && name != "all")
                most = *ms, longest = stageInWords(name);
        if (most > 0)
            parts.push_back(fmt::format("{}: {}, {:.0f}{}%", run->variant->name, longest,
                                        100 * std::min(most / run->time->median, 1.0), kThinSpace));
    }
    if (parts.empty()) return {};
    std::string text = "The longest stage, and its share of the time: ";
    for (std::size_t i = 0; i < parts.size(); ++i) text += (i > 0 ? "; " : "") + parts[i];
    return text + ".";
}

std::string stagesTable(const PageSource& source, double resolution) {
    std::vector<std::string> stages;
    const std::vector<const PageRun*> runs = runsAt(source, resolution);
    for (const PageRun* run : runs)
        for (const auto& [name, value] : partOf(*run->json, "stages_ms").items())
            if (std::find(stages.begin(), stages.end(), name) == stages.end()) stages.push_back(name);
    PageTable table{"", {{"", PageCell::words}}, {}};
    for (const std::string& stage : stages) table.columns.push_back({stageInWords(stage)});
    table.columns.push_back({"whole", PageCell::time});
    for (const PageRun* run : runs) {
        std::vector<std::string> row{run->variant->name};
        for (const std::string& stage : stages) {
            const auto ms = numberOf(partOf(*run->json, "stages_ms", stage));
            row.push_back(ms && *ms > 0 ? timeText(*ms) : "");
        }
        row.push_back(timeText(run->time->median));
        table.rows.push_back(std::move(row));
    }
    return tableHtml(table);
}

std::string ratesTable(const PageSource& source) {
    PageTable table{
        "What this machine's memory does",
        {{"threads"}, {"fill"}, {"copy"}, {"first touch"}, {"first touch, large pages"}, {"simple steps"}},
        {}};
    const auto rate = [](const Json& json) {
        const auto value = numberOf(json);
        return value ? threeDigits(*value) + kThinSpace + "GB/s" : "";
    };
    for (const Json& m : entriesOf(partOf(source.json(), "roofline", "machine"))) {
        const auto threads = numberOf(partOf(m, "threads")), steps = numberOf(partOf(m, "steps_a_ms"));
        table.rows.push_back({threads ? wholeText(*threads) : "", rate(partOf(m, "fill_gb_s")),
                              rate(partOf(m, "copy_gb_s")), rate(partOf(m, "first_touch_gb_s")),
                              rate(partOf(m, "first_touch_large_pages_gb_s")),
                              steps ? amountText(*steps * 1e3) + " a second" : ""});
    }
    return tableHtml(table);
}

std::string rooflineTable(const PageSource& source) {
    PageTable table{"",
                    {{"", PageCell::words},
                     {"resolution"},
                     {"least bytes"},
                     {"least time"},
                     {"time"},
                     {"times the least"},
                     {"reached"}},
                    {}};
    for (const Json& r : entriesOf(partOf(source.json(), "roofline", "runs"))) {
        const auto cell = [&](const char* key, std::string (*text)(double)) {
            const auto value = numberOf(partOf(r, key));
            return value ? text(*value) : std::string();
        };
        std::string rate = cell("gb_s", threeDigits);
        if (!rate.empty()) rate += std::string(kThinSpace) + "GB/s";
        table.rows.push_back({source.variant(r).name, cell("resolution", wholeText),
                              cell("least_bytes", bytesText), cell("least_ms", timeText),
                              cell("ms", timeText), cell("times_least", threeDigits), rate});
    }
    return tableHtml(table);
}

std::string rooflineSentence(const PageSource& source) {
    const Json* best = nullptr;
    for (const Json& r : entriesOf(partOf(source.json(), "roofline", "runs")))
        if (const auto times = numberOf(partOf(r, "times_least")); times && !source.variant(r).isAgain())
            if (!best || *times < *numberOf(partOf(*best, "times_least"))) best = &r;
    if (!best) return {};
    const auto resolution = numberOf(partOf(*best, "resolution"));
    return fmt::format("Nearest to it comes {}{}, with {} the least time.", source.variant(*best).name,
                       resolution ? " at " + wholeText(*resolution) + " points" : "",
                       timesText(*numberOf(partOf(*best, "times_least"))));
}

/// "64^3" with a raised 3.
std::string caseInWords(const std::string& words) {
    std::string raised;
    for (std::size_t i = 0; i < words.size(); ++i)
        if (words.compare(i, 2, "^3") == 0)
            raised += "\u00b3", ++i;
        else
            raised += words[i];
    return raised;
}

}  // namespace

PlotFigure scalingFigure(const PageSource& source, const std::string& axis) {
    const bool isResolution = axis == "resolution";
    const std::string unit = isResolution ? "points" : "elements";
    PlotFigure figure{"Time against " + axis, {}, {}};
    XyPlot plot;
    for (const Growth& growth : growthsOf(source, axis))
        if (!growth.points.empty()) plot.series.push_back(growthSeries(growth, unit));
    if (isResolution) addUnfitted(source, plot);
    if (plot.series.empty()) return figure;
    plot.x = {isResolution ? "points along the longest side of the grid" : "elements of the mesh",
              isResolution ? AxisUnit::plain : AxisUnit::amount,
              false,
              false,
              {},
              {}};
    if (isResolution) plot.x.ticks = askedResolutions(source);
    plot.y = {"time; below is faster", AxisUnit::time, false, false, {}, {}};
    std::vector<std::string> present;
    for (const XySeries& series : plot.series) present.push_back(series.shortLabel);
    figure.note = source.missingPeers(present);
    figure.panels.emplace_back(
        [plot = std::move(plot)](const PlotCanvas& canvas) { return drawXyPlot(plot, canvas); });
    return figure;
}

std::string scalingSection(const PageSource& source, const std::string& axis) {
    const std::string figure = figureHtml(scalingFigure(source, axis));
    if (figure.empty()) return {};
    const bool isResolution = axis == "resolution";
    const std::vector<Growth> growths = growthsOf(source, axis);
    std::string how =
        isResolution ? "Uniform grids, from coarse to fine."
                     : "The same grid in boxes of more and more elements, whose sizes differ tenfold an axis";
    if (!isResolution) {
        const auto resolution = numberOf(partOf(source.json(), "scaling", "elements_resolution"));
        how += resolution ? fmt::format(", {} points along its longest side.", wholeText(*resolution)) : ".";
    }
    how +=
        " Dotted lines are fits: time grows as a power of what is below, and the power stands beside the "
        "name.";
    return sectionHtml(
        "by-" + axis, isResolution ? "Time against resolution" : "Time against elements",
        paragraphHtml(how) +
            paragraphHtml(growthSentence(growths, isResolution ? "points along each side" : "elements"),
                          "says") +
            besideHtml(figure, growthTable(growths, isResolution ? "for twice the points a side"
                                                                 : "for twice the elements")));
}

PlotFigure stagesFigure(const PageSource& source) {
    PlotFigure figure{"What the time is spent on", {}, {}};
    const auto resolution = commonResolution(source);
    if (!resolution) return figure;
    BarPlot plot{"", "share of the time", {}, {}};
    StageKinds kinds;
    std::vector<std::string> present;
    for (const PageRun* run : runsAt(source, *resolution)) {
        plot.rows.push_back(stageRow(*run, kinds));
        present.push_back(run->variant->name);
    }
    plot.key = kinds.key();
    if (plot.rows.empty()) return figure;
    figure.note = source.missingPeers(present);
    figure.panels.emplace_back(
        [plot = std::move(plot)](const PlotCanvas& canvas) { return drawBarPlot(plot, canvas); });
    return figure;
}

std::string stagesSection(const PageSource& source) {
    const std::string figure = figureHtml(stagesFigure(source));
    const auto resolution = commonResolution(source);
    if (figure.empty() || !resolution) return {};
    return sectionHtml(
        "stages", "What the time is spent on",
        paragraphHtml(fmt::format(
            "A uniform grid of {} points along its longest side. Each bar is the whole time of one "
            "variant, which stands at its end; its parts are the stages. Of other programs there "
            "is nothing but their sampling.",
            wholeText(*resolution))) +
            paragraphHtml(stagesSentence(source, *resolution), "says") + figure +
            detailsHtml("All stages in figures", stagesTable(source, *resolution)));
}

PlotFigure rooflineFigure(const PageSource& source) {
    PlotFigure figure{"Time over the least that memory needs", {}, {}};
    XyPlot plot;
    std::set<double> resolutions;
    for (const PageVariant& v : source.variants()) {
        XySeries series{v.name, v.name, v.style, {}, true, {}};
        for (const Json& r : entriesOf(partOf(source.json(), "roofline", "runs"))) {
            const auto resolution = numberOf(partOf(r, "resolution")),
                       times = numberOf(partOf(r, "times_least"));
            if (&source.variant(r) != &v || v.isAgain() || !resolution || !times || *times <= 0) continue;
            resolutions.insert(*resolution);
            series.points.push_back({*resolution, *times, 0, 0,
                                     fmt::format("{}, {} points: {} the least", v.name,
                                                 wholeText(*resolution), timesText(*times)),
                                     0});
        }
        if (!series.points.empty()) plot.series.push_back(std::move(series));
    }
    if (plot.series.empty()) return figure;
    plot.x = {"points along the longest side of the grid", AxisUnit::plain, false, false, {},
              {resolutions.begin(), resolutions.end()}};
    plot.y = {"time over the least; below is better", AxisUnit::times, false, false, {}, {}};
    plot.level = 1;
    plot.levelLabel = "the least that memory needs";
    std::vector<std::string> present;
    for (const XySeries& series : plot.series) present.push_back(series.label);
    figure.note = source.missingPeers(present);
    figure.panels.emplace_back(
        [plot = std::move(plot)](const PlotCanvas& canvas) { return drawXyPlot(plot, canvas); });
    return figure;
}

std::string rooflineSection(const PageSource& source) {
    const std::string figure = figureHtml(rooflineFigure(source)), rates = ratesTable(source);
    if (figure.empty() && rates.empty()) return {};
    return sectionHtml(
        "roofline", "How near to what memory allows",
        paragraphHtml(
            "The mesh has to be read and the voxels have to be written once. What "
            "this machine's memory needs for "
            "that alone is the dashed line; what fits into caches aside, nothing can be below it.") +
            paragraphHtml(rooflineSentence(source), "says") + besideHtml(figure, rates) +
            detailsHtml("All of it in figures", rooflineTable(source)));
}

std::string warmSection(const PageSource& source) {
    PageTable table{"",
                    {{"", PageCell::words},
                     {"what", PageCell::words},
                     {"left", PageCell::words},
                     {"time", PageCell::time},
                     {"95 % interval"},
                     {"binding, once"},
                     {"drawing"},
                     {"processors"},
                     {"uploaded"},
                     {"read back"},
                     {"pairs"},
                     {"a pair"}},
                    {}};
    for (const Json& w : entriesOf(partOf(source.json(), "warm"))) {
        const auto cell = [&](const char* key, std::string (*text)(double)) {
            const auto value = numberOf(partOf(w, key));
            return value ? text(*value) : std::string();
        };
        const auto time = pageTimeOf(partOf(w, "ms"));
        const auto perPair = numberOf(partOf(w, "ns_a_pair"));
        table.rows.push_back({source.variant(w).name, caseInWords(wordsOf(partOf(w, "case"))),
                              wordsOf(partOf(w, "to")) == "device" ? "on the device" : "in blocks",
                              time ? timeText(time->median) : "", time ? rangeText(*time) : "",
                              cell("bind_ms", timeText), cell("render_ms", timeText),
                              cell("processor_ms", timeText), cell("upload_bytes", bytesText),
                              cell("read_back_bytes", bytesText), cell("pairs", wholeText),
                              perPair ? timeText(*perPair * 1e-6) : ""});
    }
    const std::string html = tableHtml(table);
    if (html.empty()) return {};
    return sectionHtml("warm", "Warm runs",
                       paragraphHtml("The mesh is bound already, as in a viewer that asks for brick after "
                                     "brick. Results end in blocks in "
                                     "memory, or stay on the device. Pairs are of an element and a block or "
                                     "slice that it is sampled into.") +
                           html);
}

}  // namespace tessera
