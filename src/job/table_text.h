#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

/// Rows of cells; the first row is the heading.
using TableRows = std::vector<std::vector<std::string>>;

/// How a table that is too wide is taken apart.
struct TableShape {
    std::size_t keys = 1;         ///< columns at the left that name a row: aligned left, and repeated
    std::string_view glued = "";  ///< a column with this heading stays with the one before it
};

/// Rows as aligned columns. A table that is too wide becomes several with the same rows, and names lose their
/// middle only where they leave no room for a single column.
/// @param width columns of text there are.
std::string formatTable(const TableRows& rows, std::size_t width, const TableShape& shape = {});

}  // namespace tessera
