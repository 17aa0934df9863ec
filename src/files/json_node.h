#pragma once

#include <initializer_list>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tessera/vec.h"

namespace tessera {

/// A value of a JSON file that people write, with its place for messages. Whatever isn't as expected throws
/// InputError: "scene.json: camera.eye: expected three numbers".
class JsonNode {
  public:
    /// A whole file. @param what it is, such as "the scene".
    static JsonNode read(const std::string& path, const std::string& what);

    /// What a program has made. @param name in place of a file's.
    static JsonNode of(nlohmann::json json, const std::string& name);

    /// An object that has no other keys than these.
    void expectKeys(std::initializer_list<std::string_view> known) const;
    /// Of an object: null where there is no such key.
    std::optional<JsonNode> find(const std::string& key) const;
    JsonNode at(const std::string& key) const;
    std::vector<JsonNode> list(const std::string& expected) const;

    double number() const;
    /// Within [least, most].
    double number(double least, double most) const;
    /// Above 0.
    double length() const;
    int whole(int least, int most) const;
    bool flag() const;
    std::string text() const;
    /// The path of a file; a relative one counts from the folder of the file that it stands in.
    std::string filePath() const;
    std::vector<double> numbers(std::size_t count) const;
    Vec3d vector() const;

    /// Throws InputError: "FILE: PLACE: expected ...".
    [[noreturn]] void fail(const std::string& expected) const;
    /// Throws InputError: "FILE: PLACE: ...".
    [[noreturn]] void refuse(const std::string& why) const;

  private:
    JsonNode(std::shared_ptr<const std::string> path, std::shared_ptr<const nlohmann::json> root,
             const nlohmann::json& json, std::string place);
    std::string placeOf(const std::string& key) const;

    std::shared_ptr<const std::string> path_;
    std::shared_ptr<const nlohmann::json> root_;
    const nlohmann::json* json_;
    std::string place_;  // empty: the file as a whole
};

}  // namespace tessera
