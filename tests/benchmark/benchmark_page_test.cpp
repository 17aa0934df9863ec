#include "benchmark/benchmark_page.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace tessera {
namespace {

constexpr const char* kPeers[] = {"VTK", "other tool"};
constexpr std::size_t kPlots = 12;

Json timeJson(double ms) {
    return {{"median", ms}, {"low", ms * 0.97}, {"high", ms * 1.04}, {"count", 9}};
}

Json variantJson(const std::string& name, const char* role) {
    return {{"name", name}, {"algorithm", name}, {"role", role}, {"note", ""}};
}

Json variantsJson(int variations) {
    Json variants = Json::array();
    for (const char* const name : {"software", "compute", "hybrid", "slicing"})
        variants.push_back(variantJson(name, "main"));
    variants.push_back(variantJson("software again", "again"));
    for (int i = 0; i < variations; ++i)
        variants.push_back(variantJson("software, variation " + std::to_string(i), "variation"));
    variants.push_back(variantJson("slicing-2001", "published"));
    for (const char* const peer : kPeers) variants.push_back(variantJson(peer, "peer"));
    return variants;
}

Json runJson(const std::string& variant, const char* criterion, double resolution, double ms) {
    const double error = 3 / resolution;
    return {{"variant", variant},
            {"criterion", criterion},
            {"asked", std::to_string(int(resolution)) + " points"},
            {"resolution", resolution},
            {"levels", 1},
            {"voxels", resolution * resolution * resolution},
            {"covered", 1000},
            {"ms", timeJson(ms)},
            {"processor_ms", ms},
            {"stages_ms", {{"plan", ms * 0.25}, {"sample", ms * 0.5}}},
            {"peak_memory_bytes", 123456789},
            {"error", {{"max", error}, {"p999", error / 2}, {"rms", error / 10}}},
            {"picture_rms", error * 10}};
}

/// What each variant took: growing, and no two alike.
double msOf(std::size_t variant, double resolution) {
    return (1.37 + double(variant)) * std::pow(resolution / 32, 2.3);
}

void addRuns(Json& document) {
    for (std::size_t i = 0; i < document["variants"].size(); ++i) {
        const std::string name = document["variants"][i]["name"];
        Json points = Json::array();
        for (const double resolution : {32.0, 64.0, 128.0}) {
            const double ms = msOf(i, resolution);
            document["runs"].push_back(runJson(name, "uniform", resolution, ms));
            points.push_back({{"x", resolution}, {"ms", timeJson(ms)}});
            document["roofline"]["runs"].push_back(
                {{"variant", name}, {"resolution", resolution}, {"times_least", ms}});
        }
        if (document["variants"][i]["role"] == "main")
            document["runs"].push_back(runJson(name, "error", 80, msOf(i, 40)));
        const Json fit = {{"variant", name},
                          {"exponent", {{"value", 2.3}, {"low", 2.2}, {"high", 2.4}}},
                          {"factor_ms", msOf(i, 1)},
                          {"points", points}};
        document["scaling"]["resolution"].push_back(fit), document["scaling"]["elements"].push_back(fit);
        for (const char* const measure : {"max", "rms"})
            for (const double bound : {0.1, 0.05, 0.02, 0.01})
                document["equal_error"].push_back(
                    {{"measure", measure},
                     {"bound", bound},
                     {"variant", name},
                     {"criterion", "uniform"},
                     {"ms", bound < 0.02 ? Json() : timeJson(msOf(i, 3 / bound))},
                     {"how", bound < 0.02 ? "not reached" : "between two resolutions"}});
        document["oracle"]["variants"].push_back({{"variant", name},
                                                  {"max", double(i) * 1e-7},
                                                  {"p999", 0},
                                                  {"rms", 0},
                                                  {"holes", 0},
                                                  {"spills", 0}});
    }
}

Json documentWith(int variations) {
    Json document = {
        {"tessera", "0.9"},
        {"input", {{"mesh", "fin.vtu"}, {"field", "Density"}, {"elements", 187395}, {"nodes", 40960}}},
        {"machine", {{"processor", "a processor"}, {"threads", 2}, {"commit", nullptr}}},
        {"settings", {{"rounds", 9}, {"seconds", 12.5}}},
        {"variants", variantsJson(variations)},
        {"absent", {"cuda isn't there"}},
        {"advice", {"Take software."}}};
    addRuns(document);
    document["pareto"] = {{"max", {0, 1, 3}}, {"rms", {0, 1, 999}}};
    document["again"].push_back({{"asked", "32 points"}, {"ratio", timeJson(1.01)}, {"agrees", true}});
    document["warm"].push_back(
        {{"variant", "software"}, {"case", "64^3"}, {"to", "blocks"}, {"ms", timeJson(7.77)}});
    document["paper"]["data_sets"].push_back(
        {{"name", "fin"},
         {"grids",
          {{{"points", {128, 64, 32}},
            {"measured",
             {{"software", {{"total_ms", 30}}},
              {"slicing", {{"total_ms", 15}}},
              {"VTK", {{"total_ms", 300}}}}},
            {"published",
             {{"Software", {{"algorithm", "software"}, {"tot_s", 1.2}}},
              {"MultiComb", {{"algorithm", "slicing"}, {"tot_s", 0.69}}}}}}}}});
    return document;
}

/// The end of a tag: the first > that stands in no quotes.
std::size_t tagEnd(const std::string& text, std::size_t at) {
    bool isQuoted = false;
    for (; at < text.size(); ++at) {
        if (text[at] == '"') isQuoted = !isQuoted;
        if (text[at] == '<') return std::string::npos;
        if (text[at] == '>' && !isQuoted) return at;
    }
    return std::string::npos;
}

/// What is wrong with the nesting of tags; empty if nothing is.
std::string nestingFault(const std::string& text) {
    std::vector<std::string> open;
    for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
        const std::size_t end = tagEnd(text, at + 1);
        if (end == std::string::npos) return "a tag doesn't end: " + text.substr(at, 60);
        const bool closes = text[at + 1] == '/';
        const std::size_t begin = at + (closes ? 2 : 1);
        const std::string name =
            text.substr(begin, std::min(text.find_first_of(" >/\n", begin), end) - begin);
        if (name == "!DOCTYPE" || name == "meta" || name == "link" || text[end - 1] == '/') continue;
        if (!closes) {
            open.push_back(name);
        } else {
            if (open.empty() || open.back() != name) return "</" + name + "> closes another";
            open.pop_back();
        }
    }
    return open.empty() ? "" : "<" + open.back() + "> stays open";
}

void expectNothingIsAskedFor(const std::string& text) {
    for (const char* const asks : {"https://", "src=", "url(", "@import", "<script"})
        EXPECT_EQ(text.find(asks), std::string::npos) << asks;
    // A namespace is no address to go to.
    const std::string svgNames = "xmlns=\"http://www.w3.org/2000/svg\"";
    const std::size_t names = text.find(svgNames);
    EXPECT_EQ(text.find("http://", names == std::string::npos ? 0 : names + svgNames.size()),
              std::string::npos);
}

Json withoutNumbers(const Json& json) {
    if (!json.is_structured()) return json.is_string() ? json : Json();
    Json less = json;
    for (Json& part : less) part = withoutNumbers(part);
    return less;
}

Json withHostileNames(const Json& json) {
    if (json.is_string()) {
        const std::string words = json;
        const bool isKeyWord = words == "uniform" || words == "error" || words == "main" || words == "peer" ||
                               words == "max" || words == "rms";
        return isKeyWord ? json : Json(words + "<script>alert('1')</script>\"&]]>");
    }
    if (!json.is_structured()) return json;
    Json hostile = json;
    for (Json& part : hostile) part = withHostileNames(part);
    return hostile;
}

void collectMedians(const Json& json, std::vector<double>& medians) {
    if (json.is_object() && json.contains("median") && json["median"].is_number())
        medians.push_back(json["median"]);
    if (json.is_structured())
        for (const Json& part : json) collectMedians(part, medians);
}

/// "1.23 ms" with any space.
double millisecondsOf(const std::string& words) {
    const double value = std::stod(words);
    if (words.find("ms") != std::string::npos) return value;
    if (words.find("\u00b5s") != std::string::npos) return value / 1e3;
    return words.find("ns") != std::string::npos ? value / 1e6 : value * 1e3;
}

TEST(BenchmarkPage, IsWellFormedSmallAndAsksForNothing) {
    const std::string page = benchmarkPage(documentWith(20));
    EXPECT_EQ(nestingFault(page), "");
    EXPECT_LT(page.size(), 1'000'000u);
    EXPECT_NE(page.find("What accuracy costs in time: fin.vtu, Density"), std::string::npos);
    expectNothingIsAskedFor(page);
}

TEST(BenchmarkPage, EscapesHostileNames) {
    const Json hostile = withHostileNames(documentWith(2));
    const std::string page = benchmarkPage(hostile);
    EXPECT_EQ(nestingFault(page), "");
    expectNothingIsAskedFor(page);
    for (const PlotFile& plot : benchmarkPlots(hostile)) EXPECT_EQ(nestingFault(plot.svg), "") << plot.name;
}

TEST(BenchmarkPage, NamesEveryPeerInEveryPlot) {
    const Json document = documentWith(3);
    const std::string page = benchmarkPage(document);
    std::size_t figures = 0;
    for (std::size_t at = page.find("<figure>"); at != std::string::npos;
         at = page.find("<figure>", at + 1), ++figures)
        for (const char* const peer : kPeers)
            EXPECT_NE(page.substr(at, page.find("</figure>", at) - at).find(peer), std::string::npos)
                << peer << " in plot " << figures;
    EXPECT_EQ(figures, kPlots);
    const std::vector<PlotFile> plots = benchmarkPlots(document);
    EXPECT_EQ(plots.size(), kPlots);
    for (const PlotFile& plot : plots)
        for (const char* const peer : kPeers)
            EXPECT_NE(plot.svg.find(peer), std::string::npos) << peer << " in plot " << plot.name;
}

TEST(BenchmarkPage, PrintsMediansOfTheDocumentOnly) {
    const Json document = documentWith(5);
    const std::string page = benchmarkPage(document);
    std::vector<double> medians;
    collectMedians(document, medians);
    const std::string cell = "<td class=\"ms\">";
    std::size_t cells = 0;
    for (std::size_t at = page.find(cell); at != std::string::npos; at = page.find(cell, at + 1)) {
        const std::string words = page.substr(at + cell.size(), page.find('<', at + 1) - at - cell.size());
        if (words == "&ndash;") continue;
        ++cells;
        const double ms = millisecondsOf(words);
        EXPECT_TRUE(std::any_of(medians.begin(), medians.end(), [&](double median) {
            return std::abs(median - ms) <= 0.005 * median;
        })) << words;
    }
    EXPECT_GT(cells, document["runs"].size());
}

TEST(BenchmarkPage, LeavesOutWhatIsMissing) {
    const Json document = documentWith(2);
    for (const auto& [key, part] : document.items()) {
        Json less = document;
        less.erase(key);
        EXPECT_EQ(nestingFault(benchmarkPage(less)), "") << "without " << key;
        less[key] = "of another kind";
        EXPECT_EQ(nestingFault(benchmarkPage(less)), "") << key << " of another kind";
    }
    for (const Json& nothing : {Json(), Json::object(), Json::array(), withoutNumbers(document)}) {
        EXPECT_EQ(nestingFault(benchmarkPage(nothing)), "");
        EXPECT_TRUE(benchmarkPlots(nothing).empty());
    }
}

TEST(BenchmarkPage, SaysWhereABoundIsNotReached) {
    EXPECT_NE(benchmarkPage(documentWith(0)).find("not reached"), std::string::npos);
}

TEST(BenchmarkPlot, StandsAloneInFixedColours) {
    for (const auto& [name, svg] : benchmarkPlots(documentWith(3))) {
        EXPECT_EQ(svg.rfind("<svg xmlns=", 0), 0u);
        EXPECT_EQ(svg.find("var("), std::string::npos);
        EXPECT_EQ(nestingFault(svg), "");
        expectNothingIsAskedFor(svg);
    }
}

}  // namespace
}  // namespace tessera
