#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "benchmark/plot_parts.h"

namespace tessera {

/// What a column of a table holds, which decides its side and its class.
enum class PageCell { words, number, time };

struct TableColumn {
    std::string heading;
    PageCell kind = PageCell::number;
};

/// A cell that says that there is no such time.
inline constexpr std::string_view kNotReached = "not reached";
/// The same for one that refinement by error wasn't asked for, as it takes too long.
inline constexpr std::string_view kNotTried = "not tried";

/// Cells are text, not yet safe for HTML; empty ones become dashes, and rows without a number are left out.
struct PageTable {
    std::string caption;
    std::vector<TableColumn> columns;
    std::vector<std::vector<std::string>> rows;
};

std::string tableHtml(const PageTable& table);
/// Panels side by side where there is room, each for a wide and for a narrow window.
std::string figureHtml(const PlotFigure& figure);
std::string paragraphHtml(std::string_view words, std::string_view cssClass = "");
std::string listHtml(const std::vector<std::string>& items, std::string_view cssClass = "");
/// A figure and its table, side by side where there is room.
std::string besideHtml(const std::string& figure, const std::string& table);
/// Closed until it is opened.
std::string detailsHtml(std::string_view summary, std::string_view html);
/// Nothing if its content is empty.
std::string sectionHtml(std::string_view id, std::string_view heading, std::string_view html);
/// The whole page. @param body HTML.
std::string pageHtml(std::string_view title, std::string_view body);

}  // namespace tessera
