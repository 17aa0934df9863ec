#include "mesh_files/read_surface.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "files/input_file.h"
#include "files/named_file.h"
#include "mesh_files/raw_surface.h"
#include "mesh_files/read_ply.h"
#include "mesh_files/read_stl.h"
#include "mesh_files/read_surface_text.h"
#include "mesh_files/read_vtk.h"
#include "mesh_files/triangulate.h"
#include "surface/repair_surface.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr double kLargestCoordinate = 1e100, kSmallestCoordinate = 1e-100;
constexpr const char* kSurfaceFormats =
    ".stl, .ply, .obj, .off, .poly, .vtp (surfaces), .csv, .node (points), .vtk, .vtu (either)";

RawSurface readRaw(const std::string& path, const ReadOptions& options, const Execution& execution) {
    const std::string extension = extensionOf(path);
    if (extension == ".vtp" || extension == ".vtu")
        return readVtkSurface(path, VtkFormat::xml, options, execution);
    if (extension == ".vtk") return readVtkSurface(path, VtkFormat::legacy, options, execution);
    using Reader = RawSurface (*)(const NamedText&);
    static const std::map<std::string, Reader> kReaders{{".stl", readStl}, {".off", readOff},
                                                        {".obj", readObj}, {".ply", readPly},
                                                        {".csv", readCsv}, {".node", readNodePoints}};
    const auto reader = kReaders.find(extension);
    if (reader == kReaders.end() && extension != ".poly")
        throw InputError(path + ": isn't known as a surface or points; known are " + kSurfaceFormats);
    const std::string bytes = readWholeFile(path);
    const NamedText text{path, bytes};
    if (reader != kReaders.end()) return reader->second(text);
    const std::string nodes = std::filesystem::path(path).replace_extension(".node").string();
    return readPoly(text, nodes, [&] {
        if (const auto folder = allowedFolder(path, options)) checkInFolder(*folder, path, nodes);
        return readWholeFile(nodes);
    });
}

void checkPoints(const std::string& path, const std::vector<Vec3d>& points) {
    double largest = 0;
    for (std::size_t p = 0; p < points.size(); ++p) {
        const Vec3d size = glm::abs(points[p]);
        const double here = std::max({size.x, size.y, size.z});
        if (!std::isfinite(size.x) || !std::isfinite(size.y) || !std::isfinite(size.z))
            throw InputError(path + ": the coordinates of point " + std::to_string(p) + " aren't finite");
        if (here > kLargestCoordinate)
            throw InputError(path + ": the coordinates of point " + std::to_string(p) +
                             " are too large to be computed with: at most 1e100 can be");
        largest = std::max(largest, here);
    }
    if (largest < kSmallestCoordinate && largest > 0)
        throw InputError(path + ": its coordinates are too small to be computed with, all below 1e-100");
}

/// Means of the values of the triangles around each point; NaN where there is none.
Field atPoints(const Field& field, const Surface& surface) {
    Field mean{field.name, FieldLocation::point, field.components, {}};
    const auto components = std::size_t(field.components);
    mean.values.resize(surface.points.size() * components);
    std::vector<std::int32_t> counts(surface.points.size());
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        for (const std::int32_t corner : surface.triangles[t]) {
            ++counts[std::size_t(corner)];
            for (std::size_t c = 0; c < components; ++c)
                mean.values[std::size_t(corner) * components + c] += field.values[t * components + c];
        }
    }
    for (std::size_t p = 0; p < counts.size(); ++p)
        for (std::size_t c = 0; c < components; ++c) mean.values[p * components + c] /= counts[p];
    return mean;
}

/// Point fields as they are; of the others, which have a value for every polygon, those of points.
void takeFields(RawSurface& raw, const std::vector<std::int64_t>& sources, Surface& surface) {
    for (Field& field : raw.fields) {
        if (field.location == FieldLocation::point) {
            surface.fields.push_back(std::move(field));
            continue;
        }
        Field ofTriangles{field.name, FieldLocation::cell, field.components, {}};
        for (const std::int64_t source : sources)
            for (int c = 0; c < field.components; ++c) ofTriangles.values.push_back(field.at(source, c));
        surface.fields.push_back(atPoints(ofTriangles, surface));
    }
    std::set<std::string> known;
    for (const Field& field : surface.fields) known.insert(field.name);
    std::set<std::string> taken;
    for (Field& field : surface.fields) {
        if (taken.insert(field.name).second) continue;
        const std::string name = field.name;
        for (int n = 2; known.contains(field.name); ++n) field.name = name + "_" + std::to_string(n);
        known.insert(field.name);
        taken.insert(field.name);
    }
}

}  // namespace

bool isSurfaceName(const std::string& path) {
    const std::string extension = extensionOf(path);
    for (const char* known : {".stl", ".ply", ".obj", ".off", ".poly", ".csv", ".vtp"})
        if (extension == known) return true;
    std::error_code error;
    return extension == ".node" &&
           !std::filesystem::exists(std::filesystem::path(path).replace_extension(".ele"), error);
}

SurfaceFile readSurface(const std::string& path, const ReadOptions& options, const Execution& execution) {
    if (options.timeStep > 0)
        throw InputError(path + ": there is no time step " + std::to_string(options.timeStep) +
                         "; it has 1, counted from 0");
    RawSurface raw = readRaw(path, options, execution);
    if (raw.points.empty()) throw InputError(path + ": holds no point");
    checkPoints(path, raw.points);
    SurfaceFile file;
    std::vector<std::int64_t> sources;
    file.surface.triangles = trianglesOf(path, raw, sources);
    file.surface.points = std::move(raw.points);
    takeFields(raw, sources, file.surface);
    if (raw.format == kStlFormat) mergePoints(file.surface, execution);  // every triangle has its own
    file.isOriented = raw.format != kPolyFormat;
    file.polygons = std::move(sources);
    file.format = std::move(raw.format);
    file.holesWorld = std::move(raw.holesWorld);
    file.regions = std::move(raw.regions);
    file.warnings = std::move(raw.warnings);
    return file;
}

}  // namespace tessera
