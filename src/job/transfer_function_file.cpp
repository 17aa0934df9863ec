#include "job/transfer_function_file.h"

#include <fmt/format.h>

#include <set>

#include "files/input_file.h"
#include "files/json_parse.h"

namespace tessera {

namespace {

using StopsJson = nlohmann::json;

class StopsReader {
  public:
    explicit StopsReader(const std::string& path) : path_(path) {}

    TransferFunction read() const {
        StopsJson json;
        try {
            json = parseJson<StopsJson>(readWholeFile(path_));
        } catch (const StopsJson::exception& error) {
            throw InputError(fmt::format("{}: not JSON: {}", path_, error.what()));
        }
        TransferFunction function;
        checkKeys(json, "the transfer function", {"field", "stops"});
        if (json.contains("field")) {
            if (!json["field"].is_string()) fail("field", "a name");
            function.field = json["field"].get<std::string>();
        }
        if (!json.contains("stops") || !json["stops"].is_array()) fail("stops", "a list of stops");
        for (std::size_t i = 0; i < json["stops"].size(); ++i)
            function.stops.push_back(stop(json["stops"][i], fmt::format("stops[{}]", i)));
        try {
            checkTransferFunction(function);
        } catch (const InputError& error) {
            throw InputError(fmt::format("{}: {}", path_, error.what()));
        }
        return function;
    }

  private:
    TransferFunction::Stop stop(const StopsJson& json, const std::string& place) const {
        checkKeys(json, place, {"value", "color", "opacity"});
        TransferFunction::Stop stop;
        stop.value = number(json, place, "value");
        stop.opacity = number(json, place, "opacity");
        if (!json.contains("color")) return stop;
        const StopsJson& color = json["color"];
        if (!color.is_array() || color.size() != 3) fail(place + ".color", "three numbers");
        for (std::size_t c = 0; c < 3; ++c) {
            if (!color[c].is_number()) fail(place + ".color", "three numbers");
            stop.color[c] = color[c].get<double>();
        }
        return stop;
    }

    double number(const StopsJson& json, const std::string& place, const std::string& key) const {
        if (!json.contains(key) || !json[key].is_number()) fail(place + "." + key, "a number");
        return json[key].get<double>();
    }

    void checkKeys(const StopsJson& json, const std::string& place,
                   const std::set<std::string>& known) const {
        if (!json.is_object()) throw InputError(fmt::format("{}: {}: expected an object", path_, place));
        for (const auto& [key, value] : json.items())
            if (!known.contains(key))
                throw InputError(fmt::format("{}: {}: unknown key \"{}\"; it knows {}", path_, place, key,
                                             fmt::join(known, ", ")));
    }

    [[noreturn]] void fail(const std::string& place, const std::string& expected) const {
        throw InputError(fmt::format("{}: {}: expected {}", path_, place, expected));
    }

    const std::string& path_;
};

}  // namespace

TransferFunction readTransferFunction(const std::string& path) {
    return StopsReader(path).read();
}

}  // namespace tessera
