#include "benchmark/benchmark_page.h"

#include <fmt/format.h>

#include <utility>
#include <vector>

#include "benchmark/page_accuracy.h"
#include "benchmark/page_checks.h"
#include "benchmark/page_html.h"
#include "benchmark/page_numbers.h"
#include "benchmark/page_times.h"
#include "files/html_text.h"

namespace tessera {

namespace {

std::string titleOf(const Json& document) {
    const std::string mesh = wordsOf(partOf(document, "input", "mesh")),
                      field = wordsOf(partOf(document, "input", "field"));
    std::string title = "What accuracy costs in time";
    if (!mesh.empty()) title += ": " + mesh;
    if (!field.empty()) title += (mesh.empty() ? ": " : ", ") + field;
    return title;
}

std::string meshLine(const Json& document) {
    const Json& input = partOf(document, "input");
    std::vector<std::string> parts;
    if (const auto elements = numberOf(partOf(input, "elements")))
        parts.push_back(wholeText(*elements) + " elements");
    if (const auto nodes = numberOf(partOf(input, "nodes"))) parts.push_back(wholeText(*nodes) + " nodes");
    const std::string location = wordsOf(partOf(input, "location"));
    if (!location.empty())
        parts.push_back("values at its " + (location == "point" ? std::string("points") : location + "s"));
    std::string line = parts.empty() ? "" : "The mesh: " + listInWords(parts) + ".";
    const Json& machine = partOf(document, "machine");
    std::string where = wordsOf(partOf(machine, "processor"));
    if (const auto threads = numberOf(partOf(machine, "threads")); threads && !where.empty())
        where += fmt::format(", {} thread{}", wholeText(*threads), *threads == 1 ? "" : "s");
    if (const std::string gl = wordsOf(partOf(machine, "opengl", "renderer")); !gl.empty())
        where += (where.empty() ? "" : "; OpenGL by ") + gl;
    if (!where.empty()) line += (line.empty() ? "The machine: " : " The machine: ") + where + ".";
    return line;
}

std::string headHtml(const Json& document) {
    std::vector<std::string> advice;
    for (const Json& sentence : entriesOf(partOf(document, "advice")))
        if (const std::string words = wordsOf(sentence); !words.empty()) advice.push_back(words);
    return "<header>\n<h1>" + inHtml(titleOf(document)) + "</h1>\n" + listHtml(advice, "advice") +
           paragraphHtml(meshLine(document), "soft") + "</header>\n";
}

}  // namespace

std::string benchmarkPage(const Json& document) {
    const PageSource source(document);
    const std::pair<const char*, std::string> sections[] = {
        {"<a href=\"#equal-error\">Time at equal error</a>\n", equalErrorSection(source)},
        {"<a href=\"#error-time\">Error against time</a>\n", errorTimeSection(source)},
        {"<a href=\"#by-resolution\">Resolution</a>\n", scalingSection(source, "resolution")},
        {"<a href=\"#by-elements\">Elements</a>\n", scalingSection(source, "elements")},
        {"<a href=\"#stages\">Stages</a>\n", stagesSection(source)},
        {"<a href=\"#voxels\">Voxels</a>\n", voxelSection(source)},
        {"<a href=\"#roofline\">Memory</a>\n", rooflineSection(source)},
        {"<a href=\"#exactness\">Exactness</a>\n", exactnessSection(source)},
        {"<a href=\"#warm\">Warm runs</a>\n", warmSection(source)},
        {"<a href=\"#paper\">The paper</a>\n", paperSection(source)},
        {"<a href=\"#compared\">Since the earlier run</a>\n", comparisonSection(source)},
        {"<a href=\"#method\">How it was measured</a>\n", methodSection(source)},
    };
    std::string links, body;
    for (const auto& [link, html] : sections)
        if (!html.empty()) links += link, body += html;
    if (links.empty())
        body = paragraphHtml("Nothing was measured.");
    else
        links = "<nav>\n" + links + "</nav>\n";
    return pageHtml(titleOf(document), headHtml(document) + links + body);
}

std::vector<PlotFile> benchmarkPlots(const Json& document) {
    const PageSource source(document);
    const std::pair<const char*, PlotFigure> figures[] = {
        {"time-at-equal-error", equalErrorFigure(source, "max")},
        {"time-at-equal-rms", equalErrorFigure(source, "rms")},
        {"error-against-time", errorTimeFigure(source)},
        {"time-against-resolution", scalingFigure(source, "resolution")},
        {"time-against-elements", scalingFigure(source, "elements")},
        {"stages", stagesFigure(source)},
        {"voxels-against-error", voxelFigure(source)},
        {"roofline", rooflineFigure(source)},
        {"exactness", oracleFigure(source)},
        {"pictures", pictureFigure(source)},
        {"paper", paperFigure(source)},
        {"noise", noiseFigure(source)},
    };
    std::vector<PlotFile> plots;
    for (const auto& [name, figure] : figures)
        if (!figure.panels.empty()) plots.push_back({name, standaloneSvg(figure)});
    return plots;
}

}  // namespace tessera
