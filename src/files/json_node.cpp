#include "files/json_node.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "base/text.h"
#include "files/input_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

std::string countText(std::size_t count) {
    static constexpr const char* kWords[] = {"no", "one", "two", "three", "four", "five", "six"};
    return count < std::size(kWords) ? kWords[count] : std::to_string(count);
}

constexpr std::size_t kMostBytes = 16 << 20;  // of a file: parsing takes several times that

/// The library would take the last of several keys of one name.
nlohmann::json parseOnce(const std::string& text) {
    constexpr int kDeepest = 32;
    std::vector<std::set<std::string>> keys;  // of the objects that are open
    return nlohmann::json::parse(
        text, [&](int depth, nlohmann::json::parse_event_t event, nlohmann::json& parsed) {
            using Event = nlohmann::json::parse_event_t;
            if (depth > kDeepest) throw InputError("nested more than 32 deep");
            if (event == Event::object_start) keys.emplace_back();
            if (event == Event::object_end) keys.pop_back();
            if (event == Event::key && !keys.back().insert(parsed.get<std::string>()).second)
                throw InputError("the key \"" + parsed.get<std::string>() + "\" stands twice in one object");
            return true;
        });
}

}  // namespace

JsonNode::JsonNode(std::shared_ptr<const std::string> path, std::shared_ptr<const nlohmann::json> root,
                   const nlohmann::json& json, std::string place)
    : path_(std::move(path)), root_(std::move(root)), json_(&json), place_(std::move(place)) {}

JsonNode JsonNode::read(const std::string& path, const std::string& what) {
    const std::string text = readWholeFile(path, kMostBytes);
    std::shared_ptr<const nlohmann::json> root;
    try {
        root = std::make_shared<const nlohmann::json>(parseOnce(text));
    } catch (const nlohmann::json::exception& error) {
        throw InputError(path + ": not JSON: " + error.what());
    } catch (const InputError& error) {
        throw InputError(path + ": " + error.what());
    }
    JsonNode node(std::make_shared<const std::string>(path + ": " + what), root, *root, "");
    if (!root->is_object()) node.fail("an object");
    node.path_ = std::make_shared<const std::string>(path);
    return node;
}

JsonNode JsonNode::of(nlohmann::json json, const std::string& name) {
    const auto root = std::make_shared<const nlohmann::json>(std::move(json));
    return {std::make_shared<const std::string>(name), root, *root, ""};
}

void JsonNode::expectKeys(std::initializer_list<std::string_view> known) const {
    if (!json_->is_object()) fail("an object");
    for (const auto& [key, value] : json_->items()) {
        if (std::find(known.begin(), known.end(), key) != known.end()) continue;
        std::string all;
        for (const std::string_view name : known) all += (all.empty() ? "" : ", ") + std::string(name);
        refuse("unknown key \"" + key + "\"; it knows " + (all.empty() ? "none" : all));
    }
}

std::string JsonNode::placeOf(const std::string& key) const {
    return place_.empty() ? key : place_ + "." + key;
}

std::optional<JsonNode> JsonNode::find(const std::string& key) const {
    const auto found = json_->find(key);
    if (found == json_->end()) return {};
    return JsonNode(path_, root_, *found, placeOf(key));
}

JsonNode JsonNode::at(const std::string& key) const {
    if (auto found = find(key)) return *found;
    static const nlohmann::json kNothing;
    return {path_, root_, kNothing, placeOf(key)};
}

std::vector<JsonNode> JsonNode::list(const std::string& expected) const {
    if (!json_->is_array()) fail(expected);
    std::vector<JsonNode> nodes;
    for (std::size_t i = 0; i < json_->size(); ++i)
        nodes.push_back({path_, root_, (*json_)[i], place_ + "[" + std::to_string(i) + "]"});
    return nodes;
}

double JsonNode::number() const {
    if (!json_->is_number()) fail("a number");
    const double value = json_->get<double>();
    if (!std::isfinite(value)) fail("a finite number");
    return value;
}

double JsonNode::number(double least, double most) const {
    const double value = number();
    if (!(value >= least && value <= most))
        fail("a number from " + shortNumber(least) + " to " + shortNumber(most));
    return value;
}

double JsonNode::length() const {
    const double value = number();
    if (!(value > 0)) fail("a number above 0");
    return value;
}

int JsonNode::whole(int least, int most) const {
    const double value = json_->is_number() ? json_->get<double>() : NAN;
    if (!(value >= least && value <= most) || value != std::floor(value))
        fail("a whole number from " + std::to_string(least) + " to " + std::to_string(most));
    return int(value);
}

bool JsonNode::flag() const {
    if (!json_->is_boolean()) fail("true or false");
    return json_->get<bool>();
}

std::string JsonNode::text() const {
    if (!json_->is_string()) fail("a text");
    return json_->get<std::string>();
}

std::string JsonNode::filePath() const {
    if (text().empty()) fail("the name of a file");
    return (std::filesystem::path(*path_).parent_path() / text()).string();
}

std::vector<double> JsonNode::numbers(std::size_t count) const {
    const std::string expected = countText(count) + " numbers";
    if (!json_->is_array() || json_->size() != count) fail(expected);
    std::vector<double> values;
    for (const nlohmann::json& value : *json_) {
        if (!value.is_number() || !std::isfinite(value.get<double>())) fail(expected);
        values.push_back(value.get<double>());
    }
    return values;
}

Vec3d JsonNode::vector() const {
    const std::vector<double> v = numbers(3);
    return {v[0], v[1], v[2]};
}

void JsonNode::fail(const std::string& expected) const {
    refuse("expected " + expected);
}

void JsonNode::refuse(const std::string& why) const {
    throw InputError(*path_ + ": " + (place_.empty() ? "" : place_ + ": ") + why);
}

}  // namespace tessera
