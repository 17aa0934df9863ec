#include "job/table_text.h"

#include <algorithm>
#include <numeric>

#include "job/wrap_text.h"

namespace tessera {

namespace {

constexpr std::size_t kGap = 2;  // before every column
constexpr std::size_t kShortestName = 12;

std::string padded(const std::string& text, std::size_t width, bool left) {
    const std::string space(width - std::min(width, textWidth(text)), ' ');
    return left ? text + space : space + text;
}

class Table {
  public:
    Table(TableRows rows, std::size_t width, const TableShape& shape)
        : rows_(std::move(rows)), keys_(shape.keys) {
        measure();
        keys_ = std::min(keys_, widths_.size());
        std::vector<std::vector<std::size_t>> groups = glue(shape.glued);
        std::size_t widest = 0;
        for (const auto& group : groups) widest = std::max(widest, widthOf(group));
        shortenNames(width, widest);
        for (const auto& group : groups) {
            if (parts_.empty() || widthOf(allKeys()) + widthOf(parts_.back()) + widthOf(group) > width)
                parts_.emplace_back();
            parts_.back().insert(parts_.back().end(), group.begin(), group.end());
        }
        if (parts_.empty()) parts_.emplace_back();
    }

    std::string text() const {
        std::string text;
        for (const std::vector<std::size_t>& part : parts_)
            for (const auto& row : rows_) text += lineOf(row, part);
        return text;
    }

  private:
    void measure() {
        widths_.clear();
        for (const auto& row : rows_) {
            widths_.resize(std::max(widths_.size(), row.size()));
            for (std::size_t c = 0; c < row.size(); ++c) widths_[c] = std::max(widths_[c], textWidth(row[c]));
        }
    }

    std::vector<std::size_t> allKeys() const {
        std::vector<std::size_t> keys(keys_);
        std::iota(keys.begin(), keys.end(), std::size_t(0));
        return keys;
    }

    std::size_t widthOf(const std::vector<std::size_t>& columns) const {
        std::size_t width = 0;
        for (const std::size_t c : columns) width += kGap + widths_[c];
        return width;
    }

    /// Columns that stay together.
    std::vector<std::vector<std::size_t>> glue(std::string_view glued) const {
        std::vector<std::vector<std::size_t>> groups;
        for (std::size_t c = keys_; c < widths_.size(); ++c) {
            if (groups.empty() || rows_[0][c] != glued) groups.emplace_back();
            groups.back().push_back(c);
        }
        return groups;
    }

    void shortenNames(std::size_t width, std::size_t widest) {
        const std::size_t keys = widthOf(allKeys());
        if (keys_ == 0 || keys + widest <= width) return;
        // The longest of the key columns gives way.
        const auto longest = std::size_t(
            std::max_element(widths_.begin(), widths_.begin() + std::ptrdiff_t(keys_)) - widths_.begin());
        const std::size_t over = keys + widest - width;
        const std::size_t room = widths_[longest] - std::min(widths_[longest], over);
        for (auto& row : rows_) row[longest] = shortened(row[longest], std::max(room, kShortestName));
        measure();
    }

    std::string lineOf(const std::vector<std::string>& row, const std::vector<std::size_t>& part) const {
        std::string line;
        for (const std::size_t c : allKeys())
            line += std::string(kGap, ' ') + padded(row[c], widths_[c], true);
        for (const std::size_t c : part)
            line += std::string(kGap, ' ') + padded(c < row.size() ? row[c] : "", widths_[c], false);
        line.erase(line.find_last_not_of(' ') + 1);
        return line + "\n";
    }

    TableRows rows_;
    std::size_t keys_;
    std::vector<std::size_t> widths_;
    std::vector<std::vector<std::size_t>> parts_;
};

}  // namespace

std::string formatTable(const TableRows& rows, std::size_t width, const TableShape& shape) {
    return rows.empty() ? std::string() : Table(rows, width, shape).text();
}

}  // namespace tessera
