#include "vdb/report_json.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "files/json_parse.h"
#include "tessera/error.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json numbers(const std::vector<double>& values) {
    Json list = Json::array();
    for (double value : values) list.push_back(number(value));
    return list;
}

double readNumber(const Json& json) {
    return json.is_null() ? std::numeric_limits<double>::quiet_NaN() : json.get<double>();
}

std::vector<double> readNumbers(const Json& json) {
    std::vector<double> values;
    for (const Json& entry : json) values.push_back(readNumber(entry));
    return values;
}

Json fieldToJson(const FieldError& field) {
    Json json;
    json["name"] = field.name;
    json["components"] = field.components;
    json["location"] = field.location;
    json["range"] = number(field.range);
    json["max"] = number(field.max);
    json["p999"] = number(field.p999);
    json["rms"] = number(field.rms);
    json["relative_max"] = number(field.relativeMax);
    json["relative_p999"] = number(field.relativeP999);
    json["relative_rms"] = number(field.relativeRms);
    json["worst_place"] =
        numbers({field.worstPlaceWorld.x, field.worstPlaceWorld.y, field.worstPlaceWorld.z});
    json["samples"] = field.samples;
    json["skipped_samples"] = field.skippedSamples;
    json["valid_points"] = field.validPoints;
    json["integral_mesh"] = numbers(field.integralMesh);
    json["integral_lattice"] = numbers(field.integralLattice);
    return json;
}

template <class Integer>
void read(const Json& json, const char* key, Integer& value) {
    value = readInteger<Integer>(json.at(key), key);
}

FieldError fieldFromJson(const Json& json) {
    FieldError field;
    json.at("name").get_to(field.name);
    read(json, "components", field.components);
    json.at("location").get_to(field.location);
    field.range = readNumber(json.at("range"));
    field.max = readNumber(json.at("max"));
    field.p999 = readNumber(json.at("p999"));
    field.rms = readNumber(json.at("rms"));
    field.relativeMax = readNumber(json.at("relative_max"));
    field.relativeP999 = readNumber(json.at("relative_p999"));
    field.relativeRms = readNumber(json.at("relative_rms"));
    const std::vector<double> place = readNumbers(json.at("worst_place"));
    if (place.size() == 3) field.worstPlaceWorld = {place[0], place[1], place[2]};
    read(json, "samples", field.samples);
    read(json, "skipped_samples", field.skippedSamples);
    read(json, "valid_points", field.validPoints);
    field.integralMesh = readNumbers(json.at("integral_mesh"));
    field.integralLattice = readNumbers(json.at("integral_lattice"));
    return field;
}

}  // namespace

std::string reportToJson(const ErrorReport& report) {
    Json json;
    json["fields"] = Json::array();
    for (const FieldError& field : report.fields) json["fields"].push_back(fieldToJson(field));
    json["fully_covered_share"] = number(report.fullyCoveredShare);
    json["nodes"] = report.nodes;
    json["centroids"] = report.centroids;
    json["outside_bricks"] = report.outsideBricks;
    if (report.incomplete > 0) json["incomplete_samples"] = report.incomplete;
    json["covered_points"] = report.coveredPoints;
    json["flat_elements"] = report.flatElements;
    json["inverted_elements"] = report.invertedElements;
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

ErrorReport reportFromJson(const std::string& text) {
    try {
        const Json json = parseJson<Json>(text);
        ErrorReport report;
        for (const Json& field : json.at("fields")) report.fields.push_back(fieldFromJson(field));
        report.fullyCoveredShare = readNumber(json.at("fully_covered_share"));
        read(json, "nodes", report.nodes);
        read(json, "centroids", report.centroids);
        read(json, "outside_bricks", report.outsideBricks);
        if (json.contains("incomplete_samples")) read(json, "incomplete_samples", report.incomplete);
        read(json, "covered_points", report.coveredPoints);
        read(json, "flat_elements", report.flatElements);
        read(json, "inverted_elements", report.invertedElements);
        return report;
    } catch (const Json::exception& error) {
        throw InputError(std::string("the error report is damaged: ") + error.what());
    }
}

}  // namespace tessera
