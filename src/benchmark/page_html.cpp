#include "benchmark/page_html.h"

#include <fmt/format.h>

#include "files/html_text.h"

namespace tessera {

namespace {

constexpr const char* kPageStyle = R"(
html { font: 16px/1.55 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; -webkit-text-size-adjust: 100%; }
body { margin: 0; background: var(--ground); color: var(--ink); }
main { max-width: 84rem; margin: 0 auto; padding: 1rem 1rem 3rem; }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 1rem 0 .75rem; overflow-wrap: anywhere; }
h2 { font-size: 1.3rem; line-height: 1.25; margin: 3rem 0 .5rem; padding-top: 1rem; border-top: 1px solid var(--grid); }
h3 { font-size: 1.05rem; margin: 1.75rem 0 .25rem; }
p, ul, ol { max-width: 46rem; margin: .5rem 0; overflow-wrap: anywhere; }
ul, ol { padding-left: 1.4rem; }
.advice { list-style: none; padding: 1rem 1.1rem; margin: 1rem 0; background: var(--panel); border-left: 4px solid var(--k0);
  border-radius: 4px; font-size: 1.1rem; }
.advice li + li { margin-top: .5rem; }
.soft, figcaption { color: var(--soft); font-size: .92rem; }
.says { font-weight: 600; }
nav { margin: 1.25rem 0 0; font-size: .92rem; }
nav a { display: inline-block; margin: 0 1rem .3rem 0; }
a { color: var(--k0); }
figure { margin: 1rem 0; }
.panels { display: grid; grid-template-columns: minmax(0, 1fr); gap: 1.75rem 2rem; }
svg { display: block; width: 100%; height: auto; overflow: visible; }
.wide { display: none; max-width: 44rem; }
.beside { display: grid; grid-template-columns: minmax(0, 1fr); gap: 0 2.5rem; }
.narrow { max-width: 30rem; }
.scroll { overflow-x: auto; margin: .75rem 0; max-width: 100%; }
table { border-collapse: separate; border-spacing: 0; font-size: .87rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding: .25rem 0; }
th, td { padding: .25rem .6rem; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--grid); }
th { vertical-align: bottom; font-weight: 600; color: var(--soft); white-space: normal; max-width: 8rem; }
td.w, th.w { text-align: left; }
td.none { color: var(--soft); }
td:first-child, th:first-child { padding-left: 0; position: sticky; left: 0; background: var(--ground);
  max-width: 11rem; overflow: hidden; text-overflow: ellipsis; }
tbody tr:hover, tbody tr:hover td:first-child { background: var(--panel); }
details { margin: .75rem 0; }
summary { cursor: pointer; color: var(--k0); padding: .25rem 0; }
dl { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: .2rem 1rem; max-width: 60rem; font-size: .92rem; }
dt { color: var(--soft); }
dd { margin: 0; overflow-wrap: anywhere; }
.front { columns: 23rem; column-gap: 2rem; max-width: none; font-size: .92rem; }
@media (min-width: 44rem) { .wide { display: block; } .narrow { display: none; } main { padding: 1rem 2rem 4rem; } }
@media screen and (min-width: 66rem) { .beside { grid-template-columns: minmax(0, 1.1fr) minmax(0, 1fr); } .beside .scroll { margin-top: 1rem; }
  .panels.many { grid-template-columns: repeat(2, minmax(0, 1fr)); } }
@media (min-width: 130rem) { html { font-size: 20px; } .wide { max-width: none; } .panels:not(.many) .wide { max-width: 44rem; } }
)";

constexpr const char* kPrintStyle = R"(
@page { margin: 14mm; }
@media print {
  html { font-size: 11px; }
  body { background: #fff; color: #000; -webkit-print-color-adjust: exact; print-color-adjust: exact; }
  main { max-width: none; padding: 0; }
  nav { display: none; }
  details::details-content { content-visibility: visible; display: block; }
  .wide { display: block; max-width: 13cm; } .narrow { display: none; }
  .panels.many { grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 1rem; }
  svg, tr, .advice, li, p { break-inside: avoid; }
  h2, h3, caption, .soft, .says, section > p { break-after: avoid; } figure { break-before: avoid; }
  td:first-child { max-width: none; position: static; }
  .scroll { overflow: visible; }
  table { font-size: 8.5px; } th, td { padding: .15rem .3rem; white-space: normal; }
}
)";

const char* classOf(PageCell kind) {
    return kind == PageCell::words ? " class=\"w\"" : kind == PageCell::time ? " class=\"ms\"" : "";
}

/// Rows without a single number say nothing.
bool hasNumbers(const std::vector<std::string>& row, const std::vector<TableColumn>& columns) {
    for (std::size_t i = 0; i < row.size() && i < columns.size(); ++i)
        if (columns[i].kind != PageCell::words && !row[i].empty()) return true;
    return false;
}

std::string rowHtml(const std::vector<std::string>& row, const std::vector<TableColumn>& columns) {
    std::string html = "<tr>";
    for (std::size_t i = 0; i < row.size() && i < columns.size(); ++i)
        html += fmt::format(
            "<td{}>{}</td>",
            row[i] == kNotReached || row[i] == kNotTried ? " class=\"none\"" : classOf(columns[i].kind),
            row[i].empty() ? "&ndash;" : inHtml(row[i]));
    return html + "</tr>\n";
}

}  // namespace

std::string tableHtml(const PageTable& table) {
    std::string body;
    for (const auto& row : table.rows)
        if (hasNumbers(row, table.columns)) body += rowHtml(row, table.columns);
    if (body.empty()) return {};
    std::string html = "<div class=\"scroll\"><table>\n";
    if (!table.caption.empty()) html += fmt::format("<caption>{}</caption>\n", inHtml(table.caption));
    html += "<thead><tr>";
    for (const TableColumn& column : table.columns)
        html += fmt::format("<th{}>{}</th>", column.kind == PageCell::words ? classOf(column.kind) : "",
                            inHtml(column.heading));
    html += "</tr></thead>\n<tbody>\n";
    return html + body + "</tbody></table></div>\n";
}

std::string figureHtml(const PlotFigure& figure) {
    if (figure.panels.empty()) return {};
    std::string html =
        fmt::format("<figure>\n<div class=\"panels{}\">\n", figure.panels.size() > 1 ? " many" : "");
    for (const PlotPanel& panel : figure.panels)
        html += "<div>\n" + inlineSvg(panel(kWideCanvas), "wide", figure.about) +
                inlineSvg(panel(kNarrowCanvas), "narrow", figure.about) + "</div>\n";
    html += "</div>\n";
    if (!figure.note.empty()) html += fmt::format("<figcaption>{}</figcaption>\n", inHtml(figure.note));
    return html + "</figure>\n";
}

std::string besideHtml(const std::string& figure, const std::string& table) {
    if (figure.empty() || table.empty()) return figure + table;
    return "<div class=\"beside\">\n<div>" + figure + "</div>\n<div>" + table + "</div>\n</div>\n";
}

std::string paragraphHtml(std::string_view words, std::string_view cssClass) {
    if (words.empty()) return {};
    const std::string named = cssClass.empty() ? "" : fmt::format(" class=\"{}\"", cssClass);
    return fmt::format("<p{}>{}</p>\n", named, inHtml(words));
}

std::string listHtml(const std::vector<std::string>& items, std::string_view cssClass) {
    if (items.empty()) return {};
    const char* const tag = cssClass == "front" ? "ol" : "ul";
    std::string html =
        fmt::format("<{}{}>\n", tag, cssClass.empty() ? "" : fmt::format(" class=\"{}\"", cssClass));
    for (const std::string& item : items) html += fmt::format("<li>{}</li>\n", inHtml(item));
    return html + fmt::format("</{}>\n", tag);
}

std::string detailsHtml(std::string_view summary, std::string_view html) {
    if (html.empty()) return {};
    return fmt::format("<details><summary>{}</summary>\n{}</details>\n", inHtml(summary), html);
}

std::string sectionHtml(std::string_view id, std::string_view heading, std::string_view html) {
    if (html.empty()) return {};
    return fmt::format("<section id=\"{}\">\n<h2>{}</h2>\n{}</section>\n", id, inHtml(heading), html);
}

std::string pageHtml(std::string_view title, std::string_view body) {
    // The icon, empty, keeps browsers from asking for one.
    return fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<meta name=\"color-scheme\" content=\"light dark\">\n<link rel=\"icon\" href=\"data:,\">\n"
        "<title>{}</title>\n<style>\n:root{{color-scheme:light dark;{}}}\n"
        "@media screen and (prefers-color-scheme: dark) {{ :root{{{}}} "
        "}}\n{}{}{}</style>\n</head>\n<body>\n<main>\n{}"
        "</main>\n</body>\n</html>\n",
        inHtml(title), plotVariables(false), plotVariables(true), kPageStyle,
        plotRules(PlotColours::fromPage), kPrintStyle, body);
}

}  // namespace tessera
