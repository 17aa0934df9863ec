#include <glob.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "io/input_file.h"
#include "io/read_mesh.h"
#include "io/xml_tags.h"

namespace tessera {

namespace {

bool isDigit(char c) {
    return c >= '0' && c <= '9';
}

/// Order in which run_2 comes before run_10.
bool naturallyBefore(const std::string& a, const std::string& b) {
    std::size_t i = 0, j = 0;
    while (i < a.size() && j < b.size()) {
        if (!isDigit(a[i]) || !isDigit(b[j])) {
            if (a[i] != b[j]) return a[i] < b[j];
            ++i, ++j;
            continue;
        }
        const auto number = [](const std::string& s, std::size_t& at) {
            while (at < s.size() && s[at] == '0') ++at;
            const std::size_t begin = at;
            while (at < s.size() && isDigit(s[at])) ++at;
            return std::string_view(s).substr(begin, at - begin);
        };
        const std::string_view x = number(a, i), y = number(b, j);
        if (x.size() != y.size()) return x.size() < y.size();
        if (x != y) return x < y;
    }
    if (i < a.size() || j < b.size()) return j < b.size();
    return a < b;  // only leading zeros differ
}

std::vector<std::string> expandPattern(const std::string& pattern) {
    glob_t found{};
    const int result = ::glob(pattern.c_str(), 0, nullptr, &found);
    std::vector<std::string> files;
    if (result == 0) files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    ::globfree(&found);
    if (files.empty()) throw InputError(pattern + ": no file matches");
    std::sort(files.begin(), files.end(), naturallyBefore);
    return files;
}

/// Value of an attribute in a tag; empty when it is absent.
std::string valueOf(std::string_view tag, std::string_view name) {
    return decodeEntities(attributeOf(tag, name).value_or(""));
}

/// Files that a .pvd collection names, by time; ties keep the order of the file.
std::vector<std::string> readCollection(const std::string& path) {
    const std::string whole = readWholeFile(path);
    const std::string_view text = whole;
    if (text.find("<VTKFile") == std::string_view::npos || text.find("<Collection") == std::string_view::npos)
        throw InputError(path + ": isn't a .pvd file: expected <VTKFile type=\"Collection\">");
    if (text.find("</VTKFile>") == std::string_view::npos)
        throw InputError(path + ": cut off at byte " + std::to_string(text.size()) +
                         ": there is no </VTKFile>");
    struct Step {
        double time;
        std::string file;
    };
    std::vector<Step> steps;
    const std::filesystem::path folder = std::filesystem::path(path).parent_path();
    for (std::size_t at = text.find("<DataSet"); at != std::string_view::npos;
         at = text.find("<DataSet", at + 1)) {
        const std::string_view tag = text.substr(at, text.find('>', at) - at);
        const std::string name = valueOf(tag, "file");
        if (name.empty())
            throw InputError(path + ": byte " + std::to_string(at) + ": a DataSet without a file");
        const std::string timeText = valueOf(tag, "timestep");
        double time = double(steps.size());
        if (!timeText.empty()) {
            const auto result = std::from_chars(timeText.data(), timeText.data() + timeText.size(), time);
            if (result.ec != std::errc())
                throw InputError(path + ": byte " + std::to_string(at) + ": timestep is '" + timeText +
                                 "', expected a number");
        }
        steps.push_back({time, (folder / name).string()});
    }
    if (steps.empty()) throw InputError(path + ": names no files");
    std::stable_sort(steps.begin(), steps.end(),
                     [](const Step& a, const Step& b) { return a.time < b.time; });
    std::vector<std::string> files;
    for (Step& step : steps) {
        if (!std::filesystem::exists(step.file))
            throw InputError(path + ": names " + step.file + ", which doesn't exist");
        files.push_back(std::move(step.file));
    }
    return files;
}

}  // namespace

std::vector<std::string> listSeries(const std::string& pathOrPattern) {
    std::error_code error;
    if (std::filesystem::exists(pathOrPattern, error)) {
        if (pathOrPattern.ends_with(".pvd") || pathOrPattern.ends_with(".PVD"))
            return readCollection(pathOrPattern);
        return {pathOrPattern};
    }
    if (pathOrPattern.find_first_of("*?") == std::string::npos)
        throw InputError(pathOrPattern + ": there is no such file");
    return expandPattern(pathOrPattern);
}

}  // namespace tessera
