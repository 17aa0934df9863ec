#include "benchmark/page_source.h"

#include <algorithm>

#include "benchmark/page_numbers.h"

namespace tessera {

namespace {

int rankOf(const std::string& role) {
    const char* const order[] = {"main", "published", "peer", "variation", "again"};
    return int(std::find(std::begin(order), std::end(order), role) - std::begin(order));
}

}  // namespace

std::optional<double> PageRun::error(std::string_view measure) const {
    return numberOf(partOf(*json, "error", measure));
}

PageSource::PageSource(const Json& document) : document_(document) {
    readVariants();
    const Json::array_t& runs = entriesOf(partOf(document, "runs"));
    for (std::size_t i = 0; i < runs.size(); ++i) {
        const Json& run = runs[i];
        runs_.push_back({i, &variant(run), wordsOf(partOf(run, "criterion")), wordsOf(partOf(run, "asked")),
                         numberOf(partOf(run, "resolution")), numberOf(partOf(run, "voxels")),
                         numberOf(partOf(run, "picture_rms")), pageTimeOf(partOf(run, "ms")), &run});
    }
}

void PageSource::readVariants() {
    for (const Json& v : entriesOf(partOf(document_, "variants"))) {
        const std::string role = wordsOf(partOf(v, "role")), name = wordsOf(partOf(v, "name"));
        const bool isKnown = std::any_of(variants_.begin(), variants_.end(),
                                         [&](const PageVariant& other) { return other.name == name; });
        if (name.empty() || isKnown) continue;
        variants_.push_back({name,
                             wordsOf(partOf(v, "algorithm")),
                             role.empty() ? "main" : role,
                             wordsOf(partOf(v, "note")),
                             {}});
    }
    addNamesIn(document_);
    std::stable_sort(variants_.begin(), variants_.end(), [](const PageVariant& a, const PageVariant& b) {
        return rankOf(a.role) < rankOf(b.role);
    });
    giveStyles();
}

/// Variants that are spoken of and not listed.
void PageSource::addNamesIn(const Json& json) {
    if (json.is_object())
        if (const std::string name = wordsOf(partOf(json, "variant")); !name.empty())
            if (std::none_of(variants_.begin(), variants_.end(),
                             [&](const auto& v) { return v.name == name; }))
                variants_.push_back({name, name, "main", "", {}});
    if (json.is_structured())
        for (const Json& part : json) addNamesIn(part);
}

void PageSource::giveStyles() {
    constexpr int kPeerColours[] = {kInkColour, 4, 5};
    int mains = 0, peers = 0;
    for (PageVariant& v : variants_) {
        if (v.isVariation() || v.isAgain()) {
            v.style.isFaint = true;
        } else if (v.isPeer()) {
            v.style = {kPeerColours[peers % 3], (4 + peers) % kPlotShapes, 4 + peers % 2, false, false};
            ++peers;
        } else {
            // A method as it was published has the colour of what became of it.
            const auto kin = std::find_if(variants_.begin(), variants_.end(), [&](const PageVariant& other) {
                return other.role == "main" && v.role == "published" && !other.name.empty() &&
                       v.name.rfind(other.name, 0) == 0;
            });
            if (kin != variants_.end())
                v.style = {kin->style.colour, kin->style.shape, 5, true, false};
            else
                v.style = {mains % 6, mains % kPlotShapes, mains % 4, false, false}, ++mains;
        }
    }
}

const PageVariant& PageSource::variant(const Json& entry) const {
    static const PageVariant kUnnamed{"unnamed", "", "variation", "", {0, 0, 0, false, true}};
    const std::string name = wordsOf(partOf(entry, "variant"));
    const auto found =
        std::find_if(variants_.begin(), variants_.end(), [&](const auto& v) { return v.name == name; });
    return found == variants_.end() ? kUnnamed : *found;
}

std::vector<std::string> PageSource::peers() const {
    std::vector<std::string> names;
    for (const PageVariant& v : variants_)
        if (v.isPeer()) names.push_back(v.name);
    return names;
}

std::string PageSource::missingPeers(const std::vector<std::string>& present) const {
    std::vector<std::string> missing;
    for (const std::string& peer : peers())
        if (std::find(present.begin(), present.end(), peer) == present.end()) missing.push_back(peer);
    return missing.empty() ? "" : "Not measured here: " + listInWords(missing) + ".";
}

std::string criterionInWords(const std::string& criterion) {
    if (criterion.empty()) return "any grid";
    if (criterion == "error") return "by error";
    if (criterion == "element size") return "by element size";
    return criterion == "focus" ? "around a focus" : criterion;
}

std::string measureInWords(const std::string& measure) {
    return measure == "max" ? "largest error" : measure == "rms" ? "typical error (RMS)" : measure;
}

}  // namespace tessera
