#include "benchmark/page_accuracy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>

#include "benchmark/dot_plot.h"
#include "benchmark/page_html.h"
#include "benchmark/page_numbers.h"
#include "benchmark/xy_plot.h"

namespace tessera {

namespace {

constexpr const char* kMeasures[] = {"max", "rms"};
constexpr int kUniformShape = 0, kAdaptiveShape = 3;

std::string capitalised(std::string words) {
    if (!words.empty()) words[0] = char(std::toupper(words[0]));
    return words;
}

/// What one variant needs for one bound by one criterion.
struct EqualError {
    const PageVariant* variant = nullptr;
    std::string measure, criterion, how;
    double bound = 0;
    std::optional<PageTime> time;
    std::optional<double> voxels, resolution;
};

std::vector<EqualError> equalErrors(const PageSource& source) {
    std::vector<EqualError> all;
    for (const Json& e : entriesOf(partOf(source.json(), "equal_error"))) {
        const auto bound = numberOf(partOf(e, "bound"));
        if (!bound) continue;
        all.push_back({&source.variant(e), wordsOf(partOf(e, "measure")), wordsOf(partOf(e, "criterion")),
                       wordsOf(partOf(e, "how")), *bound, pageTimeOf(partOf(e, "ms")),
                       numberOf(partOf(e, "voxels")), numberOf(partOf(e, "resolution"))});
    }
    return all;
}

/// From the coarsest bound to the finest.
std::vector<double> boundsOf(const std::vector<EqualError>& all) {
    std::set<double, std::greater<>> bounds;
    for (const EqualError& e : all) bounds.insert(e.bound);
    return {bounds.begin(), bounds.end()};
}

std::string tipOf(const EqualError& e) {
    std::string tip =
        fmt::format("{}, {}: {}", e.variant->name, criterionInWords(e.criterion), intervalText(*e.time));
    if (e.voxels) tip += fmt::format(", {} voxels", amountText(*e.voxels));
    if (e.resolution) tip += fmt::format(", {} points along the longest side", threeDigits(*e.resolution));
    return e.how.empty() ? tip : tip + ", " + e.how;
}

DotRow equalErrorRow(const PageVariant& variant, const std::vector<EqualError>& all,
                     const std::string& measure, double bound) {
    DotRow row{variant.name, variant.style, {}, "not measured", false};
    for (const EqualError& e : all) {
        if (e.variant != &variant || e.measure != measure || e.bound != bound) continue;
        if (!e.time) {
            if (row.marks.empty()) row.note = e.how == kNotTried ? "not tried by error" : kNotReached;
            continue;
        }
        const bool isUniform = e.criterion == "uniform";
        row.marks.push_back({e.time->median, e.time->low, e.time->high,
                             isUniform ? kUniformShape : kAdaptiveShape, isUniform, tipOf(e),
                             timeText(e.time->median)});
    }
    if (!row.marks.empty()) row.note.clear();
    return row;
}

bool isShownAlways(const PageVariant& v) {
    return !v.isVariation() && !v.isAgain();
}

std::string fastestSentence(const std::vector<EqualError>& all, const std::string& measure) {
    std::vector<std::string> parts;
    for (const double bound : boundsOf(all)) {
        const EqualError* best = nullptr;
        for (const EqualError& e : all)
            if (e.measure == measure && e.bound == bound && e.time && isShownAlways(*e.variant))
                if (!best || e.time->median < best->time->median) best = &e;
        parts.push_back(best ? fmt::format("{}: {}, {}, in {}", boundText(bound), best->variant->name,
                                           criterionInWords(best->criterion), timeText(best->time->median))
                             : fmt::format("{}: none gets there", boundText(bound)));
    }
    if (parts.empty()) return {};
    std::string text = "The fastest for a " + measureInWords(measure) + " of at most ";
    for (std::size_t i = 0; i < parts.size(); ++i) text += (i > 0 ? "; " : "") + parts[i];
    return text + ".";
}

PageTable equalErrorTable(const PageSource& source, const std::vector<EqualError>& all,
                          const std::string& measure, bool ofVariations) {
    PageTable table{capitalised(measureInWords(measure)) + " of at most",
                    {{"", PageCell::words}, {"grid", PageCell::words}},
                    {}};
    const std::vector<double> bounds = boundsOf(all);
    for (const double bound : bounds) table.columns.push_back({boundText(bound), PageCell::time});
    for (const PageVariant& variant : source.variants())
        for (const char* const criterion : {"uniform", "error"}) {
            if (variant.isAgain() || variant.isVariation() != ofVariations) continue;
            std::vector<std::string> row{variant.name, criterionInWords(criterion)};
            bool isKnown = false;
            for (const double bound : bounds) {
                row.emplace_back();
                for (const EqualError& e : all)
                    if (e.variant == &variant && e.measure == measure && e.criterion == criterion &&
                        e.bound == bound)
                        row.back() =
                            !e.time ? (e.how == kNotTried ? e.how : std::string(kNotReached))
                                    : (e.how == "coarsest tried" ? "\u2264 " : "") + timeText(e.time->median),
                        isKnown = true;
            }
            if (isKnown) table.rows.push_back(std::move(row));
        }
    return table;
}

std::string resolutionText(const PageRun& run) {
    return run.asked.empty() ? criterionInWords(run.criterion) : run.asked;
}

std::string tipOf(const PageRun& run) {
    std::string tip = fmt::format("{}, {}: ", run.variant->name, resolutionText(run));
    if (run.time) tip += intervalText(*run.time);
    if (const auto max = run.error("max")) tip += ", largest error " + percentText(*max);
    if (const auto rms = run.error("rms")) tip += ", RMS " + percentText(*rms);
    if (run.voxels) tip += fmt::format(", {} voxels", amountText(*run.voxels));
    if (run.pictureRms) tip += fmt::format(", picture {} of 255", threeDigits(*run.pictureRms));
    return tip;
}

std::vector<const PageRun*> frontOf(const PageSource& source, const std::string& measure) {
    std::vector<const PageRun*> front;
    for (const Json& entry : entriesOf(partOf(source.json(), "pareto", measure))) {
        const auto index = numberOf(entry);
        if (!index || *index < 0 || *index >= double(source.runs().size())) continue;
        const PageRun& run = source.runs()[std::size_t(*index)];
        if (run.time && run.error(measure) && !run.variant->isAgain()) front.push_back(&run);
    }
    std::stable_sort(front.begin(), front.end(),
                     [](const PageRun* a, const PageRun* b) { return a->time->median < b->time->median; });
    return front;
}

/// The uniform runs are also shown beside others where a variant has no others, as peers have none.
bool belongsIn(const PageRun& run, bool isAdaptive, const std::set<const PageVariant*>& adaptive) {
    if (run.variant->isAgain()) return false;
    if (run.isUniform()) return !isAdaptive || (run.variant->isPeer() && !adaptive.count(run.variant));
    return isAdaptive;
}

PlotStyle criterionStyle(PlotStyle style, const std::string& criterion) {
    if (criterion == "element size") style.shape = 5, style.dash = 2;
    if (criterion == "focus") style.shape = 6, style.dash = 2;
    return style;
}

XyPlot errorTimePanel(const PageSource& source, const std::string& measure, bool isAdaptive) {
    XyPlot plot;
    plot.title = measureInWords(measure) + (isAdaptive ? ", adaptive grids" : ", uniform grids");
    plot.title = capitalised(plot.title);
    plot.x = {measureInWords(measure) + "; closer to the right", AxisUnit::share, true, false, {}, {}};
    plot.y = {"time; below is faster", AxisUnit::time, false, false, {}, {}};
    const std::vector<const PageRun*> front = frontOf(source, measure);
    std::set<const PageVariant*> adaptive;
    for (const PageRun& run : source.runs())
        if (!run.isUniform()) adaptive.insert(run.variant);
    std::map<std::pair<const PageVariant*, std::string>, std::size_t> places;
    for (const PageRun& run : source.runs()) {
        const auto error = run.error(measure);
        if (!run.time || !error || *error <= 0 || run.time->median <= 0 || run.variant->isAgain()) continue;
        plot.x.range.include(*error), plot.y.range.include(run.time->median);
        if (!belongsIn(run, isAdaptive, adaptive)) continue;
        const auto [place, isNew] = places.try_emplace({run.variant, run.criterion}, plot.series.size());
        if (isNew) {
            plot.series.push_back(
                {run.variant->name, {}, criterionStyle(run.variant->style, run.criterion), {}, true, {}});
            XySeries& added = plot.series.back();
            if (isAdaptive && run.criterion != "error")
                added.shortLabel = run.isUniform() ? run.variant->name : run.criterion,
                added.label += ", " + (run.isUniform() ? "uniform" : run.criterion);
        }
        const auto onFront = std::find(front.begin(), front.end(), &run);
        const int frontNumber = onFront == front.end() ? 0 : int(onFront - front.begin()) + 1;
        plot.series[place->second].points.push_back(
            {*error, run.time->median, run.time->low, run.time->high, tipOf(run), frontNumber});
    }
    for (const PageRun* run : front) plot.front.push_back({*run->error(measure), run->time->median});
    if (plot.series.empty()) plot.front.clear();
    return plot;
}

std::string frontSentence(const PageSource& source, const std::string& measure) {
    std::vector<std::string> names;
    for (const PageRun* run : frontOf(source, measure))
        if (std::find(names.begin(), names.end(), run->variant->name) == names.end())
            names.push_back(run->variant->name);
    if (names.empty()) return {};
    const std::string about = fmt::format("By the {}, ", measureInWords(measure));
    if (names.size() == 1) return about + names[0] + " is the fastest at every error.";
    std::string text = about + "the fastest are, depending on the error: ";
    for (std::size_t i = 0; i < names.size(); ++i) text += (i > 0 ? "; " : "") + names[i];
    return text + ".";
}

std::vector<std::string> frontMembers(const PageSource& source, const std::string& measure) {
    std::vector<std::string> members;
    for (const PageRun* run : frontOf(source, measure))
        members.push_back(fmt::format("{}, {}: {} for {}", run->variant->name, resolutionText(*run),
                                      timeText(run->time->median), percentText(*run->error(measure))));
    return members;
}

/// Curves of different variants that are the same, as what is sampled often is.
struct SharedCurve {
    std::string criterion;
    std::vector<const PageVariant*> variants;
    std::vector<XyPoint> points;
};

/// Whether each point of one is one of the other's.
bool isPartOf(const std::vector<XyPoint>& part, const std::vector<XyPoint>& whole) {
    constexpr double kSame = 0.02;
    const auto near = [](double p, double q) {
        return std::abs(p - q) <= kSame * std::max(std::abs(p), std::abs(q));
    };
    return std::all_of(part.begin(), part.end(), [&](const XyPoint& p) {
        return std::any_of(whole.begin(), whole.end(),
                           [&](const XyPoint& q) { return near(p.x, q.x) && near(p.y, q.y); });
    });
}

/// Gives a curve's variant to one that is the same as far as both go. Returns whether there is one.
bool joinsAnother(const SharedCurve& curve, std::vector<SharedCurve>& others) {
    for (SharedCurve& other : others) {
        if (other.criterion != curve.criterion) continue;
        if (isPartOf(other.points, curve.points))
            other.points = curve.points;
        else if (!isPartOf(curve.points, other.points))
            continue;
        other.variants.push_back(curve.variants.front());
        return true;
    }
    return false;
}

template <class PlaceOf>
std::vector<SharedCurve> sharedCurves(const PageSource& source, const PlaceOf& placeOf) {
    std::vector<SharedCurve> curves;
    std::vector<std::string> criteria;
    for (const PageRun& run : source.runs())
        if (std::find(criteria.begin(), criteria.end(), run.criterion) == criteria.end())
            criteria.push_back(run.criterion);
    for (const std::string& criterion : criteria)
        for (const PageVariant& variant : source.variants()) {
            SharedCurve curve{criterion, {&variant}, {}};
            if (!isShownAlways(variant)) continue;
            for (const PageRun& run : source.runs())
                if (run.variant == &variant && run.criterion == criterion)
                    if (const std::optional<std::array<double, 2>> place = placeOf(run))
                        curve.points.push_back({(*place)[0], (*place)[1], 0, 0, tipOf(run), 0});
            if (curve.points.empty()) continue;
            if (!joinsAnother(curve, curves)) curves.push_back(std::move(curve));
        }
    return curves;
}

/// "uniform: software, compute, VTK"; ours become "ours" where they are all alike.
XySeries seriesOf(const SharedCurve& curve, std::size_t ours, int indexOfCriterion, int indexInCriterion) {
    std::vector<std::string> names, peers;
    for (const PageVariant* v : curve.variants) (v->isPeer() ? peers : names).push_back(v->name);
    const std::string criterion = criterionInWords(curve.criterion);
    if (names.size() > 1)
        names = {names.size() == ours ? "all of ours" : fmt::format("{} of ours", names.size())};
    names.insert(names.end(), peers.begin(), peers.end());
    std::string all = criterion + ": ";
    for (std::size_t i = 0; i < names.size(); ++i) all += (i > 0 ? ", " : "") + names[i];
    const std::string peerNames = listInWords(peers);
    const std::string shorter = peers.empty()                  ? criterion
                                : names.size() == peers.size() ? peerNames
                                                               : criterion + ", " + peerNames;
    const int shapes[] = {kUniformShape, kAdaptiveShape, 5, 6};
    PlotStyle style{indexOfCriterion % 6, shapes[indexOfCriterion % 4], indexOfCriterion % 4, false, false};
    if (indexInCriterion > 0)
        style.isHollow = true, style.dash = 5, style.colour = peers.empty() ? style.colour : kInkColour;
    return {all, shorter, style, curve.points, true, {}};
}

template <class PlaceOf>
XyPlot sharedPlot(const PageSource& source, const PlaceOf& placeOf, std::vector<std::string>& present) {
    XyPlot plot;
    const std::vector<SharedCurve> curves = sharedCurves(source, placeOf);
    std::map<std::string, std::size_t> ours;
    for (const SharedCurve& curve : curves)
        for (const PageVariant* v : curve.variants) ours[curve.criterion] += v->isPeer() ? 0 : 1;
    std::vector<std::string> criteria;
    int inCriterion = 0;
    for (const SharedCurve& curve : curves) {
        if (criteria.empty() || criteria.back() != curve.criterion)
            criteria.push_back(curve.criterion), inCriterion = 0;
        plot.series.push_back(
            seriesOf(curve, ours[curve.criterion], int(criteria.size()) - 1, inCriterion++));
        for (const PageVariant* v : curve.variants) present.push_back(v->name);
    }
    return plot;
}

std::string voxelSentence(const PageSource& source) {
    const std::vector<EqualError> all = equalErrors(source);
    std::vector<double> bounds = boundsOf(all);
    std::reverse(bounds.begin(), bounds.end());
    for (const double bound : bounds)
        for (const EqualError& uniform : all)
            for (const EqualError& adaptive : all)
                if (uniform.measure == "max" && adaptive.measure == "max" &&
                    uniform.variant == adaptive.variant && uniform.bound == bound &&
                    adaptive.bound == bound && uniform.criterion == "uniform" &&
                    adaptive.criterion == "error" && uniform.voxels && adaptive.voxels)
                    return fmt::format(
                        "For a largest error of {}, a uniform grid of {} needs {} voxels and one refined by "
                        "error {}.",
                        boundText(bound), uniform.variant->name, amountText(*uniform.voxels),
                        amountText(*adaptive.voxels));
    return {};
}

std::vector<std::string> namesOf(const XyPlot& plot) {
    std::vector<std::string> names;
    for (const XySeries& s : plot.series) names.push_back(s.shortLabel.empty() ? s.label : s.shortLabel);
    return names;
}

}  // namespace

PlotFigure equalErrorFigure(const PageSource& source, const std::string& measure) {
    const std::vector<EqualError> all = equalErrors(source);
    PlotFigure figure{"Time at an equal " + measureInWords(measure), {}, {}};
    AxisSpec axis{"time; further left is faster", AxisUnit::time, false, false, {}, {}};
    std::vector<DotPlot> plots;
    for (const double bound : boundsOf(all)) {
        DotPlot plot{fmt::format("{} of at most {}", measureInWords(measure), boundText(bound)),
                     {},
                     {},
                     {{kUniformShape, true, "uniform grid"}, {kAdaptiveShape, false, "refined by error"}},
                     {}};
        plot.title = capitalised(plot.title);
        bool isEmpty = true;
        for (const PageVariant& variant : source.variants())
            if (isShownAlways(variant)) {
                plot.rows.push_back(equalErrorRow(variant, all, measure, bound));
                for (const DotMark& mark : plot.rows.back().marks)
                    axis.range.include(mark.value), isEmpty = false;
            }
        if (!isEmpty) plots.push_back(std::move(plot));
    }
    for (DotPlot& plot : plots) {
        plot.x = axis;
        figure.panels.emplace_back([plot](const PlotCanvas& canvas) { return drawDotPlot(plot, canvas); });
    }
    return figure;
}

std::string equalErrorSection(const PageSource& source) {
    const std::vector<EqualError> all = equalErrors(source);
    if (all.empty()) return {};
    std::string html = paragraphHtml(
        "How long each takes until its errors are small enough. Errors are shares of the field's range, at "
        "every node of the mesh and in the middle of every element; \u2264: even the coarsest grid that was "
        "tried is "
        "close enough. An open circle is a uniform grid, a filled diamond one that is finer where the error "
        "asks for it. "
        "Lines through marks are 95 % intervals.");
    for (const char* const measure : kMeasures) {
        const std::string table = tableHtml(equalErrorTable(source, all, measure, false));
        if (table.empty()) continue;
        html += "<h3>" +
                std::string(measure == std::string("max") ? "By the largest error"
                                                          : "By the typical error (RMS)") +
                "</h3>\n" + paragraphHtml(fastestSentence(all, measure), "says") +
                figureHtml(equalErrorFigure(source, measure)) + table;
        html += detailsHtml("The same for the variations",
                            tableHtml(equalErrorTable(source, all, measure, true)));
    }
    return sectionHtml("equal-error", "Time at equal error", html);
}

PlotFigure errorTimeFigure(const PageSource& source) {
    PlotFigure figure{"Time against error", {}, {}};
    std::vector<std::string> present;
    for (const char* const measure : kMeasures)
        for (const bool isAdaptive : {false, true}) {
            XyPlot plot = errorTimePanel(source, measure, isAdaptive);
            const bool hasOwn =
                std::any_of(source.runs().begin(), source.runs().end(), [&](const PageRun& run) {
                    return run.isUniform() != isAdaptive && run.time && run.error(measure);
                });
            if (plot.series.empty() || !hasOwn) continue;
            for (const std::string& name : namesOf(plot)) present.push_back(name);
            figure.panels.emplace_back(
                [plot = std::move(plot)](const PlotCanvas& canvas) { return drawXyPlot(plot, canvas); });
        }
    if (!figure.panels.empty()) figure.note = source.missingPeers(present);
    return figure;
}

std::string errorTimeSection(const PageSource& source) {
    const std::string figure = figureHtml(errorTimeFigure(source));
    if (figure.empty()) return {};
    std::string html = paragraphHtml(
        "Each mark is one run. To the right the result is closer to the mesh's own field, further down it is "
        "there "
        "sooner: the best are at the lower right. The broad band joins the runs that no other beats in both, "
        "of all "
        "grids; they are ringed, numbered and listed below. Thin grey lines are variations. Uniform grids "
        "of other programs are repeated beside the adaptive ones.");
    for (const char* const measure : kMeasures) html += paragraphHtml(frontSentence(source, measure), "says");
    html += figure;
    for (const char* const measure : kMeasures)
        if (const std::vector<std::string> members = frontMembers(source, measure); !members.empty())
            html += "<h3>Beaten by none: " + measureInWords(measure) + "</h3>\n" + listHtml(members, "front");
    return sectionHtml("error-time", "Error against time", html);
}

PlotFigure voxelFigure(const PageSource& source) {
    PlotFigure figure{"Voxels against error", {}, {}};
    std::vector<std::string> present;
    for (const char* const measure : kMeasures) {
        XyPlot plot = sharedPlot(
            source,
            [&](const PageRun& run) -> std::optional<std::array<double, 2>> {
                const auto error = run.error(measure);
                if (!error || !run.voxels || *error <= 0 || *run.voxels <= 0) return {};
                return std::array{*error, *run.voxels};
            },
            present);
        if (plot.series.empty()) continue;
        plot.title = measureInWords(measure);
        plot.title = capitalised(plot.title);
        plot.x = {measureInWords(measure) + "; closer to the right", AxisUnit::share, true, false, {}, {}};
        plot.y = {"voxels; below is less memory", AxisUnit::amount, false, false, {}, {}};
        figure.panels.emplace_back(
            [plot = std::move(plot)](const PlotCanvas& canvas) { return drawXyPlot(plot, canvas); });
    }
    if (!figure.panels.empty()) figure.note = source.missingPeers(present);
    return figure;
}

std::string voxelSection(const PageSource& source) {
    const std::string figure = figureHtml(voxelFigure(source));
    if (figure.empty()) return {};
    return sectionHtml(
        "voxels", "Voxels against error",
        paragraphHtml(
            "How many voxels an error costs. Algorithms whose voxels and errors are the same share a "
            "curve. Shapes tell the grids apart: circles are uniform ones.") +
            paragraphHtml(voxelSentence(source), "says") + figure);
}

PlotFigure pictureFigure(const PageSource& source) {
    PlotFigure figure{"Error of a picture by voxels", {}, {}};
    std::vector<std::string> present;
    XyPlot plot = sharedPlot(
        source,
        [](const PageRun& run) -> std::optional<std::array<double, 2>> {
            if (!run.pictureRms || !run.voxels || *run.pictureRms <= 0 || *run.voxels <= 0) return {};
            return std::array{*run.voxels, *run.pictureRms};
        },
        present);
    if (plot.series.empty()) return figure;
    plot.title = "Pictures of the voxels against exact ones";
    plot.x = {"voxels", AxisUnit::amount, false, false, {}, {}};
    plot.y = {"RMS in steps of 1/255; below is closer", AxisUnit::plain, false, false, {}, {}};
    figure.panels.emplace_back(
        [plot = std::move(plot)](const PlotCanvas& canvas) { return drawXyPlot(plot, canvas); });
    figure.note = source.missingPeers(present);
    return figure;
}

}  // namespace tessera
