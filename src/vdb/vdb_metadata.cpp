#include "vdb/vdb_metadata.h"

#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "base/check.h"
#include "base/text.h"
#include "files/json_parse.h"
#include "refine/brick_result.h"
#include "tessera/error.h"
#include "vdb/report_json.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

// OpenVDB 10 refuses a transform whose determinant is below 3e-15: voxels under 1.4423e-5.
constexpr double kSmallestFileSpacing = 1.5e-5;
constexpr double kComfortableFileSpacing = 2e-5;
constexpr int kMaxLevels = 31;
constexpr int kMaxIndex = 1 << 30;

[[noreturn]] void damaged(const std::string& what) {
    throw InputError("damaged Tessera metadata: " + what);
}

const std::string& entry(const std::map<std::string, std::string>& entries, const std::string& key) {
    const auto found = entries.find(key);
    if (found == entries.end()) damaged("there is no " + key);
    return found->second;
}

double readDouble(const std::string& text, const std::string& key) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
        damaged(key + " is '" + text + "', not a number");
    return value;
}

template <class Enum, std::size_t N>
Enum readChoice(const std::string& text, const std::string& key,
                const std::array<std::pair<const char*, Enum>, N>& choices) {
    for (const auto& [name, value] : choices) {
        if (text == name) return value;
    }
    damaged(key + " is '" + text + "'");
}

constexpr std::array<std::pair<const char*, VdbLayout>, 2> kLayouts{
    {{"levels", VdbLayout::levels}, {"flat", VdbLayout::flat}}};
constexpr std::array<std::pair<const char*, UpAxis>, 3> kUpAxes{
    {{"keep", UpAxis::keep}, {"y", UpAxis::y}, {"z", UpAxis::z}}};

template <class Enum, std::size_t N>
std::string choiceName(Enum value, const std::array<std::pair<const char*, Enum>, N>& choices) {
    for (const auto& [name, choice] : choices) {
        if (choice == value) return name;
    }
    throwInternalError("known choice", __FILE__, __LINE__, "an enumerator has no name");
}

std::string encodeTree(const BrickTree& tree) {
    Json json;
    json["origin"] = {tree.originWorld().x, tree.originWorld().y, tree.originWorld().z};
    json["spacing"] = tree.spacingWorld(0);
    json["brick_cells"] = tree.brickCells();
    Json levels = Json::array();
    for (int level = 0; level < tree.levelCount(); ++level) levels.push_back(Json::array());
    for (const BrickKey& key : tree.leaves()) {
        Json& list = levels[std::size_t(key.level)];
        for (int axis = 0; axis < 3; ++axis) list.push_back(key.index[axis]);
    }
    json["levels"] = std::move(levels);
    return json.dump();
}

BrickTree decodeTree(const std::string& text) {
    const Json json = parseJson<Json>(text);
    Vec3d origin;
    for (int axis = 0; axis < 3; ++axis) origin[axis] = json.at("origin").at(std::size_t(axis)).get<double>();
    const double spacing = json.at("spacing").get<double>();
    const int brickCells = readInteger<int>(json.at("brick_cells"), "brick_cells");
    if (!(spacing > 0) || !std::isfinite(spacing)) damaged("the spacing of the bricks isn't positive");
    if (brickCells != 8 && brickCells != 16 && brickCells != 32 && brickCells != 64)
        damaged("bricks of " + std::to_string(brickCells) + " cells");
    const Json& levels = json.at("levels");
    if (levels.size() > kMaxLevels) damaged(std::to_string(levels.size()) + " levels");
    if (!std::isfinite(std::ldexp(spacing, int(levels.size()))))
        damaged("the spacing of the coarsest level isn't finite");
    std::vector<BrickKey> leaves;
    for (std::size_t level = 0; level < levels.size(); ++level) {
        const Json& list = levels[level];
        if (list.size() % 3 != 0) damaged("the brick table isn't made of triples");
        // Points of level 0 inside the brick must stay within the indices that a lattice can have.
        const std::int64_t limit = kMaxIndex / (std::int64_t(brickCells) << level);
        for (std::size_t i = 0; i < list.size(); i += 3) {
            BrickKey key;
            key.level = int(level);
            for (int axis = 0; axis < 3; ++axis) {
                const std::int64_t index =
                    readInteger<std::int64_t>(list[i + std::size_t(axis)], "a brick index");
                if (index < -limit || index >= limit)
                    damaged("brick index " + std::to_string(index) + " out of range");
                key.index[axis] = int(index);
            }
            leaves.push_back(key);
        }
    }
    try {
        return BrickTree(origin, spacing, brickCells, std::move(leaves));
    } catch (const InternalError& error) {
        damaged(std::string("the brick table doesn't fit together: ") + error.what());
    }
}

int channelCount(const std::vector<OutputField>& fields) {
    int channels = 0;
    for (const OutputField& field : fields) channels += field.components;
    return channels;
}

std::string encodeBounds(const Box3d& box) {
    return Json{box.min.x, box.min.y, box.min.z, box.max.x, box.max.y, box.max.z}.dump();
}

Box3d decodeBounds(const std::string& text) {
    const Json json = parseJson<Json>(text);
    if (json.size() != 6) damaged("tessera_bounds isn't six numbers");
    Box3d box;
    for (int axis = 0; axis < 3; ++axis) {
        box.min[axis] = json.at(std::size_t(axis)).get<double>();
        box.max[axis] = json.at(std::size_t(axis) + 3).get<double>();
        if (!(box.min[axis] < box.max[axis])) damaged("tessera_bounds is no box");
    }
    return box;
}

std::string encodeFields(const std::vector<OutputField>& fields) {
    Json json = Json::array();
    for (const OutputField& field : fields) {
        Json grids = Json::array();
        for (const GridPlan& grid : planGrids({field})) grids.push_back(grid.name);
        json.push_back({{"name", field.name},
                        {"source", field.sourceName},
                        {"location", field.location},
                        {"components", field.components},
                        {"first_channel", field.firstChannel},
                        {"grids", std::move(grids)}});
    }
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::vector<OutputField> decodeFields(const std::string& text) {
    const Json json = parseJson<Json>(text);
    std::vector<OutputField> fields;
    int channels = 0;
    for (const Json& entry : json) {
        OutputField field;
        field.name = plainName(entry.at("name").get<std::string>());
        field.sourceName = plainName(entry.at("source").get<std::string>());
        entry.at("location").get_to(field.location);
        field.components = readInteger<int>(entry.at("components"), "components");
        field.firstChannel = readInteger<int>(entry.at("first_channel"), "first_channel");
        if (field.components < 1 || field.components > 64)
            damaged("a field of " + std::to_string(field.components) + " components");
        if (field.firstChannel != channels) damaged("the fields' channels don't follow each other");
        channels += field.components;
        fields.push_back(std::move(field));
    }
    return fields;
}

}  // namespace

std::vector<GridPlan> planGrids(const std::vector<OutputField>& fields) {
    std::vector<GridPlan> grids;
    for (const OutputField& field : fields) {
        if (field.components == 1 || field.components == 3) {
            grids.push_back({field.name, field.name, field.components, field.firstChannel});
            continue;
        }
        for (int c = 0; c < field.components; ++c)
            grids.push_back({field.name + "_" + std::to_string(c), field.name, 1, field.firstChannel + c});
    }
    return grids;
}

std::string gridName(const std::string& base, VdbLayout layout, int level) {
    return layout == VdbLayout::flat ? base : base + "_level_" + std::to_string(level);
}

void checkOutputFields(const std::vector<OutputField>& fields, bool hasSurface) {
    std::set<std::string> names{"coverage"};
    if (hasSurface) names.insert("surface");
    for (const GridPlan& grid : planGrids(fields)) {
        if (grid.name.empty())
            throw InputError("a grid needs a name: give the field another with --field name=newname");
        // OpenVDB marks grids of equal names by this character, so it can't be part of one.
        if (grid.name.find('\x1e') != std::string::npos)
            throw InputError("a grid's name can't hold the character 0x1e");
        if (!names.insert(grid.name).second) {
            std::string source = grid.field;
            for (const OutputField& field : fields)
                if (field.name == grid.field && !field.sourceName.empty()) source = field.sourceName;
            throw InputError("two grids of the output would be named '" + grid.name +
                             "': rename a field with --field " + source + "=newname");
        }
    }
}

double chooseUnitScale(double finestSpacingWorld, double requested) {
    if (requested != 0) {
        if (!(requested > 0) || !std::isfinite(requested))
            throw InputError("the unit scale must be a positive number");
        if (finestSpacingWorld * requested < kSmallestFileSpacing) {
            throw InputError("with unit scale " + exactText(requested) + " the finest voxel is " +
                             exactText(finestSpacingWorld * requested) +
                             " file units, and OpenVDB takes none below " + exactText(kSmallestFileSpacing) +
                             ": give a larger --unit-scale");
        }
        return requested;
    }
    double scale = 1;
    if (finestSpacingWorld >= kComfortableFileSpacing) return scale;
    for (int power = 1; power <= 300 && finestSpacingWorld * scale < 1e-3; ++power)
        scale = readDouble("1e" + std::to_string(power), "power of ten");
    if (!(finestSpacingWorld * scale >= kSmallestFileSpacing))
        throw InputError("the finest voxel is " + exactText(finestSpacingWorld) +
                         " units: too small for OpenVDB in any unit");
    return scale;
}

VdbMetadata describeFile(const std::vector<OutputField>& fields, const BrickResult& result,
                         const VdbWriteOptions& options, double unitScale) {
    VdbMetadata metadata;
    metadata.tree = result.bricks ? *result.bricks : result.tree;
    metadata.fields = fields;
    metadata.report = result.report;
    metadata.samplesReport = result.samplesReport;
    metadata.layout = options.layout;
    metadata.version = TESSERA_VERSION;
    metadata.sourceFile = options.sourceFile;
    metadata.algorithm = options.algorithm;
    metadata.criterion = options.criterion;
    metadata.target = options.target;
    metadata.sampleFormat = options.sampleFormat;
    metadata.repair = options.repair;
    metadata.time = options.time;
    metadata.unitScale = unitScale;
    metadata.upAxis = options.upAxis;
    metadata.voxelShift = options.voxelShift;
    metadata.halfFloat = options.halfFloat;
    metadata.background = options.background;
    metadata.boundsWorld = options.boundsWorld;
    metadata.layers = options.layers;
    metadata.flatLevel = result.flatLevel;
    return metadata;
}

std::map<std::string, std::string> encodeMetadata(const VdbMetadata& metadata) {
    std::map<std::string, std::string> entries;
    entries["tessera_format"] = std::to_string(kVdbFormat);
    entries["tessera_version"] = metadata.version;
    entries["tessera_source"] = metadata.sourceFile;
    entries["tessera_algorithm"] = metadata.algorithm;
    if (!metadata.target.empty()) entries["tessera_target"] = metadata.target;
    if (!metadata.sampleFormat.empty()) entries["tessera_sample_format"] = metadata.sampleFormat;
    if (!metadata.repair.empty()) entries["tessera_repair"] = metadata.repair;
    if (metadata.time) entries["tessera_time"] = exactText(*metadata.time);
    entries["tessera_criterion"] = metadata.criterion;
    entries["tessera_layout"] = choiceName(metadata.layout, kLayouts);
    entries["tessera_up_axis"] = choiceName(metadata.upAxis, kUpAxes);
    if (metadata.voxelShift != 0) entries["tessera_voxel_shift"] = exactText(metadata.voxelShift);
    entries["tessera_unit_scale"] = exactText(metadata.unitScale);
    entries["tessera_spacing"] = exactText(metadata.tree.spacingWorld(0));
    entries["tessera_precision"] = metadata.halfFloat ? "half" : "float";
    entries["tessera_background"] = exactText(double(metadata.background));
    entries["tessera_flat_level"] = std::to_string(metadata.flatLevel);
    if (metadata.boundsWorld) entries["tessera_bounds"] = encodeBounds(*metadata.boundsWorld);
    if (metadata.layers > 0) entries["tessera_extend"] = std::to_string(metadata.layers);
    if (metadata.samplesReport) entries["tessera_samples_report"] = reportToJson(*metadata.samplesReport);
    entries["tessera_fields"] = encodeFields(metadata.fields);
    entries["tessera_report"] = reportToJson(metadata.report);
    entries["tessera_bricks"] = encodeTree(metadata.tree);
    if (metadata.statistics) entries["tessera_brick_statistics"] = encodeStatistics(*metadata.statistics);
    return entries;
}

VdbMetadata decodeMetadata(const std::map<std::string, std::string>& entries) {
    if (entries.find("tessera_format") == entries.end())
        throw InputError("not written by Tessera (it has no tessera_format)");
    const double format = readDouble(entry(entries, "tessera_format"), "tessera_format");
    if (format != kVdbFormat)
        throw InputError("it has Tessera's format " + exactText(format) + ", this version reads " +
                         std::to_string(kVdbFormat));
    VdbMetadata metadata;
    metadata.version = entry(entries, "tessera_version");
    metadata.sourceFile = entry(entries, "tessera_source");
    metadata.algorithm = entry(entries, "tessera_algorithm");
    metadata.criterion = entry(entries, "tessera_criterion");
    if (entries.contains("tessera_target")) metadata.target = entry(entries, "tessera_target");
    if (entries.contains("tessera_sample_format"))
        metadata.sampleFormat = entry(entries, "tessera_sample_format");
    if (entries.contains("tessera_repair")) metadata.repair = entry(entries, "tessera_repair");
    if (entries.contains("tessera_time")) {
        metadata.time = readDouble(entry(entries, "tessera_time"), "tessera_time");
        if (!std::isfinite(*metadata.time)) damaged("tessera_time isn't finite");
    }
    for (std::string* text : {&metadata.version, &metadata.sourceFile, &metadata.algorithm,
                              &metadata.criterion, &metadata.target, &metadata.sampleFormat})
        *text = plainName(*text);
    metadata.layout = readChoice(entry(entries, "tessera_layout"), "tessera_layout", kLayouts);
    metadata.upAxis = readChoice(entry(entries, "tessera_up_axis"), "tessera_up_axis", kUpAxes);
    if (const auto shift = entries.find("tessera_voxel_shift"); shift != entries.end()) {
        metadata.voxelShift = readDouble(shift->second, shift->first);
        if (!(std::abs(metadata.voxelShift) <= 1)) damaged("tessera_voxel_shift is out of range");
    }
    metadata.unitScale = readDouble(entry(entries, "tessera_unit_scale"), "tessera_unit_scale");
    if (!(metadata.unitScale > 0 && std::isfinite(metadata.unitScale)))
        damaged("tessera_unit_scale is out of range");
    metadata.halfFloat = entry(entries, "tessera_precision") == "half";
    metadata.background = float(readDouble(entry(entries, "tessera_background"), "tessera_background"));
    const double flatLevel = readDouble(entry(entries, "tessera_flat_level"), "tessera_flat_level");
    if (!(flatLevel >= 0 && flatLevel < kMaxLevels)) damaged("tessera_flat_level is out of range");
    metadata.flatLevel = int(flatLevel);
    if (const auto layers = entries.find("tessera_extend"); layers != entries.end()) {
        const double count = readDouble(layers->second, "tessera_extend");
        if (!(count >= 1 && count <= 64 && count == std::floor(count)))
            damaged("tessera_extend is out of range");
        metadata.layers = int(count);
    }
    try {
        metadata.fields = decodeFields(entry(entries, "tessera_fields"));
        metadata.tree = decodeTree(entry(entries, "tessera_bricks"));
        if (const auto bounds = entries.find("tessera_bounds"); bounds != entries.end())
            metadata.boundsWorld = decodeBounds(bounds->second);
    } catch (const Json::exception& error) {
        damaged(error.what());
    }
    metadata.report = reportFromJson(entry(entries, "tessera_report"));
    if (const auto report = entries.find("tessera_samples_report"); report != entries.end())
        metadata.samplesReport = reportFromJson(report->second);
    if (const auto statistics = entries.find("tessera_brick_statistics"); statistics != entries.end()) {
        if (metadata.layout == VdbLayout::flat) damaged("tessera_brick_statistics in a flat file");
        const std::int64_t cells = metadata.tree.brickCells();
        metadata.statistics = decodeStatistics(statistics->second, metadata.tree.leafCount(),
                                               channelCount(metadata.fields), cells * cells * cells);
    }
    return metadata;
}

}  // namespace tessera
