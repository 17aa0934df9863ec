#include "mesh_files/mesh_series.h"

#include <glob.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <set>
#include <string_view>
#include <tuple>

#include "base/text.h"
#include "files/input_file.h"
#include "files/xml_tags.h"
#include "tessera/error.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kBlanks = " \t\r\n";
constexpr double kTimeTolerance = 1e-9;
constexpr std::size_t kMostEntries = 100000;

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

/// The files that one word names.
std::vector<std::string> expand(const std::string& word) {
    std::error_code error;
    if (fs::exists(word, error)) return {word};
    if (word.find_first_of("*?") == std::string::npos) throw InputError(word + ": there is no such file");
    glob_t found{};
    const int result = ::glob(word.c_str(), 0, nullptr, &found);
    std::vector<std::string> files;
    if (result == 0) files.assign(found.gl_pathv, found.gl_pathv + found.gl_pathc);
    ::globfree(&found);
    if (files.empty()) throw InputError(word + ": no file matches");
    return files;
}

/// The same for two ways to write one name. Links are names of their own: a step may be shown twice by one.
std::string nameKey(const std::string& path) {
    std::error_code error;
    const fs::path whole = fs::absolute(path, error);
    return (error ? fs::path(path) : whole).lexically_normal().string();
}

/// One <DataSet> of a .pvd file.
struct CollectionEntry {
    std::size_t byte = 0;
    std::optional<double> time;
    std::string part;  ///< what tells it from others of its time, as written; empty when there is no part
    std::string file;
};

/// A .pvd file while it is read.
class Collection {
  public:
    explicit Collection(const std::string& path) : path_(path), file_(path) {}
    std::vector<SeriesStep> steps();

  private:
    std::size_t checkFrame();
    CollectionEntry readEntry(const XmlTag& tag) const;
    std::optional<double> readTime(const XmlTag& tag) const;
    std::string readName(const XmlTag& tag) const;
    void checkTimes(const std::vector<CollectionEntry>& entries) const;
    void checkParts(const std::vector<CollectionEntry>& entries) const;
    [[noreturn]] void fail(std::size_t byte, const std::string& what) const {
        throw InputError(path_ + ": byte " + std::to_string(byte) + ": " + what);
    }

    std::string path_;
    InputFile file_;
};

/// Returns where the tags behind <VTKFile> begin.
std::size_t Collection::checkFrame() {
    const auto head = XmlTags(file_, 0, file_.size()).next();
    if (!head || head->name() != "VTKFile" || attributeOf(head->text, "type") != "Collection")
        throw InputError(path_ + ": isn't a .pvd file: expected <VTKFile type=\"Collection\">");
    if (file_.rfind("</VTKFile>") == InputFile::npos)
        throw InputError(path_ + ": cut off at byte " + std::to_string(file_.size()) +
                         ": there is no </VTKFile>");
    return head->end;
}

std::optional<double> Collection::readTime(const XmlTag& tag) const {
    const auto attribute = attributeOf(tag.text, "timestep");
    if (!attribute) return std::nullopt;
    std::string_view text = *attribute;
    text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
    text = text.substr(0, text.find_last_not_of(kBlanks) + 1);
    if (text.starts_with('+')) text.remove_prefix(1);
    double time = 0;
    const auto result = std::from_chars(text.data(), text.data() + text.size(), time);
    if (result.ec != std::errc() || result.ptr != text.data() + text.size() || !std::isfinite(time))
        fail(tag.begin, "timestep is " + quoted(*attribute) + ", expected a number");
    return time + 0.0;  // -0 is 0
}

std::string Collection::readName(const XmlTag& tag) const {
    const std::string name = decodeEntities(attributeOf(tag.text, "file").value_or(""));
    if (name.empty()) fail(tag.begin, "a DataSet without a file");
    const std::string path = (fs::path(path_).parent_path() / name).string();
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (!fs::exists(status)) fail(tag.begin, "names " + path + ", which doesn't exist");
    if (!fs::is_regular_file(status)) fail(tag.begin, "names " + path + ", which isn't a regular file");
    if (isCollectionName(path))
        fail(tag.begin, "names " + path + ", a .pvd file; steps have to be mesh files");
    return path;
}

CollectionEntry Collection::readEntry(const XmlTag& tag) const {
    CollectionEntry entry{tag.begin, readTime(tag), {}, readName(tag)};
    if (const auto part = attributeOf(tag.text, "part")) {
        // Some writers number parts within groups, or within names.
        entry.part = std::string(*part);
        for (const char* attribute : {"group", "name"})
            if (const auto value = attributeOf(tag.text, attribute); value && !value->empty())
                entry.part += " of " + std::string(*value);
    }
    return entry;
}

void Collection::checkTimes(const std::vector<CollectionEntry>& entries) const {
    const bool timed = entries.front().time.has_value();
    for (const CollectionEntry& entry : entries)
        if (entry.time.has_value() != timed)
            fail(entry.byte, timed ? "a DataSet without a timestep, though those before have one"
                                   : "a DataSet with a timestep, though those before have none");
}

/// A run that was continued may list a time twice, which would fill the mesh's place twice.
void Collection::checkParts(const std::vector<CollectionEntry>& entries) const {
    std::set<std::tuple<std::optional<double>, std::string>> parts, files;
    for (const CollectionEntry& entry : entries) {
        const std::string when = entry.time ? " of timestep " + exactText(*entry.time) : std::string();
        if (!entry.part.empty() && !parts.emplace(entry.time, entry.part).second)
            fail(entry.byte, "part " + entry.part + when + " is listed twice");
        const bool isOneStep = entry.time || !entry.part.empty();
        if (isOneStep && !files.emplace(entry.time, nameKey(entry.file)).second)
            fail(entry.byte, "names " + entry.file + " twice" + (entry.time ? " at" + when.substr(3) : when));
    }
}

std::vector<SeriesStep> Collection::steps() {
    std::vector<CollectionEntry> entries;
    XmlTags tags(file_, checkFrame(), file_.size());
    while (const auto tag = tags.next())
        if (tag->name() == "DataSet") {
            if (entries.size() == kMostEntries) fail(tag->begin, "more than 100,000 files are named");
            entries.push_back(readEntry(*tag));
        }
    if (entries.empty()) throw InputError(path_ + ": names no files");
    checkTimes(entries);
    checkParts(entries);
    const bool hasParts = std::any_of(entries.begin(), entries.end(),
                                      [](const CollectionEntry& entry) { return !entry.part.empty(); });
    std::stable_sort(entries.begin(), entries.end(), [](const CollectionEntry& a, const CollectionEntry& b) {
        return a.time && b.time && *a.time < *b.time;
    });
    std::vector<SeriesStep> steps;
    for (CollectionEntry& entry : entries) {
        const bool continues = !steps.empty() && steps.back().time == entry.time && (entry.time || hasParts);
        if (!continues) steps.push_back({{}, entry.time, path_, steps.size()});
        steps.back().files.push_back(std::move(entry.file));
    }
    return steps;
}

}  // namespace

bool isCollectionName(const std::string& path) {
    return path.ends_with(".pvd") || path.ends_with(".PVD");
}

std::vector<SeriesStep> listSeries(std::span<const std::string> inputs) {
    std::vector<std::string> files;
    for (const std::string& word : inputs)
        for (std::string& file : expand(word)) files.push_back(std::move(file));
    std::set<std::string> names;
    for (const std::string& file : files) {
        if (!names.insert(nameKey(file)).second) throw InputError(file + ": is given twice");
        if (!isCollectionName(file)) continue;
        if (files.size() == 1) return Collection(file).steps();
        throw InputError(file + ": a .pvd file is a series of its own and can't be given with other files");
    }
    std::sort(files.begin(), files.end(), naturallyBefore);
    std::vector<SeriesStep> steps;
    for (std::string& file : files) steps.push_back({{std::move(file)}, std::nullopt, {}, steps.size()});
    return steps;
}

std::vector<SeriesStep> stepsWithin(const std::vector<SeriesStep>& steps, const TimeRange& range) {
    std::vector<SeriesStep> chosen;
    for (const SeriesStep& step : steps) {
        if (!step.time)
            throw InputError(
                (step.collection.empty() ? step.files[0] : step.collection) +
                ": steps are chosen by time, and it has none: times come from the timesteps of a "
                ".pvd file");
        const double t = *step.time;
        const bool early = range.first && t < *range.first - kTimeTolerance * std::fabs(*range.first);
        const bool late = range.last && t > *range.last + kTimeTolerance * std::fabs(*range.last);
        if (!early && !late) chosen.push_back(step);
    }
    if (chosen.empty())
        throw InputError(steps.front().collection + ": no step lies in these times; its steps go from " +
                         exactText(*steps.front().time) + " to " + exactText(*steps.back().time));
    return chosen;
}

}  // namespace tessera
