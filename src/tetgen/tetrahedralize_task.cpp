#include "tetgen/tetrahedralize_task.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>

#include "base/machine_memory.h"
#include "base/text.h"
#include "base/timer.h"
#include "mesh/triangle_distance.h"
#include "mesh_files/assemble_mesh.h"
#include "mesh_files/read_surface.h"
#include "reader/isolated_tetrahedra.h"
#include "reader/mesh_packet.h"
#include "surface/check_surface.h"
#include "surface/exact_normal.h"
#include "surface/extend_fields.h"
#include "surface/keep_points.h"
#include "surface/shell_of_place.h"
#include "tessera/error.h"
#include "tetgen/run_tetgen.h"

namespace tessera {

namespace {

// Delaunay meshes take 10 us a point, and a point takes 30 bytes and more; quality of a surface's takes more.
constexpr double kFloorSeconds = 120, kSecondsPerByte = 50e-6, kSecondsForSizes = 3600;

constexpr double kRounding = 0x1p-49;  // of coordinates up to 1, and a little more

/// "1 point", "12 points".
std::string counted(std::int64_t count, const std::string& thing) {
    return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

/// Throws InputError where no four points span a volume. Merged points differ, so the largest isn't 0.
void checkSpan(const std::string& path, const std::vector<Vec3d>& points) {
    const std::string need = "; tetrahedra need 4 points that don't lie in one plane";
    if (points.size() < 4)
        throw InputError(path + ": holds " + counted(std::int64_t(points.size()), "different point") + need);
    // Coordinates of at most 1, so that nothing overflows.
    double largest = 0;
    for (const Vec3d& p : points) largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    const auto furthest = [&](const auto& distance) {
        std::pair<double, Vec3d> found{0, points[0] / largest};
        for (const Vec3d& p : points)
            if (const double d = distance(p / largest); d > found.first) found = {d, p / largest};
        return found;
    };
    const Vec3d origin = points[0] / largest;
    const auto [length, end] = furthest([&](const Vec3d& p) { return glm::distance(p, origin); });
    const Vec3d along = glm::normalize(end - origin);
    const auto [width, side] =
        furthest([&](const Vec3d& p) { return glm::length(glm::cross(along, p - origin)); });
    if (width < kRounding) throw InputError(path + ": all points lie on one line, but for rounding" + need);
    const Vec3d normal = glm::normalize(glm::cross(along, side - origin));
    const auto [depth, top] =
        furthest([&](const Vec3d& p) { return std::abs(glm::dot(normal, p - origin)); });
    if (depth < kRounding) throw InputError(path + ": all points lie in one plane, but for rounding" + need);
}

/// Drops elements with an edge above the limit.
std::int64_t dropLongElements(double limit, TetgenOutput& mesh) {
    const auto isLong = [&](const std::array<std::int32_t, 4>& tet) {
        for (std::size_t i = 0; i < 4; ++i)
            for (std::size_t j = 0; j < i; ++j)
                if (glm::distance(mesh.points[std::size_t(tet[i])], mesh.points[std::size_t(tet[j])]) > limit)
                    return true;
        return false;
    };
    return std::int64_t(std::erase_if(mesh.tets, isLong));
}

class Tetrahedralization {
  public:
    Tetrahedralization(const ReaderRequest& request, const Execution& execution)
        : path_(request.path),
          read_(request.options),
          options_(unpackOptions(request.body)),
          execution_(execution) {}

    MeshFile run();

  private:
    void readFile();
    void takeSeeds();
    void takeCavities();
    void warnOfLargeTriangles(const SizeField& size, const TetgenOutput& mesh);
    void checkSurface();
    TetgenOutput ofPoints();
    TetgenOutput ofSurface();
    void checkTriangles(const TetgenOutput& mesh) const;
    RawBlock blockOf(TetgenOutput mesh);
    void carryFields(const TetgenOutput& mesh, TetMesh& carried) const;
    void note(const std::string& sentence) { notes_.push_back(sentence); }
    void warn(const std::string& sentence) { file_.warnings.push_back(sentence); }
    /// Errors name the file.
    template <class Work>
    auto ofThisFile(const Work& work) const {
        try {
            return work();
        } catch (const InputError& error) {
            throw InputError(path_ + ": " + error.what());
        }
    }

    std::string path_;
    ReadOptions read_;
    TetrahedralizeOptions options_;
    Execution execution_;
    SurfaceFile file_;
    Surface& surface_ = file_.surface;
    SurfaceShells shells_;
    std::vector<char> isKept_;  // of every shell the part right within it
    std::vector<std::string> notes_;
};

void Tetrahedralization::readFile() {
    ReadOptions all = read_;
    all.fields.clear();  // one of them may hold sizes
    file_ = readSurface(path_, all, execution_);
    note(path_ + ": " + file_.format + ", " + counted(std::int64_t(surface_.points.size()), "point") +
         (surface_.triangles.empty()
              ? ""
              : " and " + counted(std::int64_t(surface_.triangles.size()), "triangle")) +
         ".");
}

/// Those of the options and of the file: each in a part of the volume of its own. Shells that look inwards
/// are holes.
void Tetrahedralization::takeSeeds() {
    auto& holes = options_.holesWorld;
    holes.insert(holes.end(), file_.holesWorld.begin(), file_.holesWorld.end());
    auto& regions = options_.regions;
    regions.insert(regions.end(), file_.regions.begin(), file_.regions.end());
    isKept_.assign(shells_.shells.size(), 1);
    takeCavities();
    const auto shellAt = [&](const std::string& what, const Vec3d& place) {
        const ShellOfPlace found = findShell(surface_, shells_, place);
        if (found.isOnSurface) throw InputError(path_ + ": " + what + " lies on the surface");
        if (found.shell < 0) throw InputError(path_ + ": " + what + " lies outside of the surface");
        return std::size_t(found.shell);
    };
    for (const Vec3d& hole : holes) isKept_[shellAt("the hole at " + placeText(hole), hole)] = 0;
    std::map<std::size_t, std::string> named;
    for (const RegionSeed& seed : regions) {
        const std::string what = "the region at " + placeText(seed.placeWorld);
        const std::size_t shell = shellAt(what, seed.placeWorld);
        if (!isKept_[shell]) throw InputError(path_ + ": " + what + " lies in a hole");
        const auto [other, isFirst] = named.emplace(shell, what);
        if (!isFirst) throw InputError(path_ + ": " + what + " lies in the same part as " + other->second);
    }
    for (std::size_t s = 0; s < isKept_.size(); ++s)
        if (shells_.shells[s].volumeWorld < 0) holes.push_back(shells_.shells[s].insideWorld);
    if (std::find(isKept_.begin(), isKept_.end(), 1) == isKept_.end())
        throw InputError(path_ + ": the holes leave nothing of the volume");
}

void Tetrahedralization::takeCavities() {
    std::int64_t cavities = 0;
    for (std::size_t s = 0; s < isKept_.size(); ++s) {
        const SurfaceShells::Shell& shell = shells_.shells[s];
        if (shell.volumeWorld >= 0) continue;
        if (shells_.shells[std::size_t(shell.parent)].volumeWorld < 0)
            throw InputError(path_ + ": the part of the surface around " + placeText(shell.insideWorld) +
                             " looks inwards, and so does the one that it lies in: a hole in a hole");
        isKept_[s] = 0;
        ++cavities;
    }
    if (cavities > 0)
        note(counted(cavities, "part") + " of the surface inside others " +
             (cavities == 1 ? "looks" : "look") + " inwards and " +
             (cavities == 1 ? "is a hole." : "are holes."));
}

void Tetrahedralization::checkSurface() {
    if (options_.repairs) {
        const SurfaceRepair repair = ofThisFile([&] { return repairSurface(surface_, execution_); });
        note("Repair of the surface: " + counted(repair.mergedPoints, "point") + " merged, " +
             counted(repair.removedTriangles, "triangle") + " removed, " +
             counted(repair.turnedTriangles, "triangle") + " turned.");
        if (surface_.triangles.empty())
            throw InputError(path_ + ": the repair leaves no triangle: none spans an area");
    } else if (!file_.isOriented) {
        ofThisFile([&] { return turnTriangles(surface_, Outwards::all, execution_); });
    }
    std::vector<SurfaceFinding> findings =
        ofThisFile([&] { return findSurfaceFaults(surface_, execution_, &shells_); });
    if (!options_.repairs)  // which renumbers them
        for (SurfaceFinding& finding : findings)
            for (std::int64_t& triangle : finding.triangles) triangle = file_.polygons[std::size_t(triangle)];
    if (!findings.empty()) throw InputError(path_ + ": " + faultSentence(findings, surface_));
    std::vector<char> isUsed(surface_.points.size());
    for (const auto& triangle : surface_.triangles)
        for (const std::int32_t corner : triangle) isUsed[std::size_t(corner)] = 1;
    const auto unused = std::count(isUsed.begin(), isUsed.end(), 0);
    if (unused == 0) return;
    note(counted(unused, "point") + " of no triangle left out.");
    keepPoints(isUsed, surface_);
}

TetgenOutput Tetrahedralization::ofPoints() {
    if (options_.size.any() || options_.splitsBoundary || options_.repairs || !options_.holesWorld.empty() ||
        !options_.regions.empty())
        throw InputError(path_ +
                         ": holds points and no triangles; sizes, --boundary, --hole, --region and "
                         "--repair-surface are for surfaces");
    if (const std::int64_t merged = mergePoints(surface_, execution_); merged > 0)
        warn(counted(merged, "point") +
             " at the same place as others merged with them, values to their means.");
    checkSpan(path_, surface_.points);
    reportStage(Stage::tetrahedralizing);
    TetgenInput input;
    input.points = surface_.points;
    TetgenOutput mesh = ofThisFile([&] { return runTetgen(input); });
    if (options_.hullLimitWorld > 0) {
        const std::int64_t dropped = dropLongElements(options_.hullLimitWorld, mesh);
        note(counted(dropped, "element") + " with an edge above " + shortNumber(options_.hullLimitWorld) +
             " left out (--hull-limit).");
        if (mesh.tets.empty())
            throw InputError(path_ + ": --hull-limit " + shortNumber(options_.hullLimitWorld) +
                             " leaves no tetrahedron: all have a longer edge");
    }
    return mesh;
}

/// Every triangle beside a part that isn't a hole is a face of the mesh, or split into such.
void Tetrahedralization::checkTriangles(const TetgenOutput& mesh) const {
    std::vector<char> isThere(surface_.triangles.size());
    for (const TetgenOutput::Face& face : mesh.faces) isThere[std::size_t(face.triangle)] = 1;
    for (std::size_t t = 0; t < isThere.size(); ++t) {
        const auto shell = std::size_t(shells_.shellOf[t]);
        const std::int32_t parent = shells_.shells[shell].parent;
        if (!isKept_[shell] && (parent < 0 || !isKept_[std::size_t(parent)]))
            isThere[t] = 1;  // and needn't be
    }
    const auto lost = std::count(isThere.begin(), isThere.end(), 0);
    if (lost == 0) return;
    const auto first = std::find(isThere.begin(), isThere.end(), 0) - isThere.begin();
    throw InputError(path_ + ": TetGen loses " + counted(lost, "triangle") + " of " +
                     std::to_string(isThere.size()) + ", the first near " +
                     placeText(surface_.points[std::size_t(surface_.triangles[std::size_t(first)][0])]) +
                     ": it takes points for one that are closer than about 1e-8 of the surface's size");
}

/// Elements at triangles that stay as they are get no smaller than these.
void Tetrahedralization::warnOfLargeTriangles(const SizeField& size, const TetgenOutput& mesh) {
    constexpr double kLarge = 2;
    std::int64_t large = 0;
    for (const TetgenOutput::Face& face : mesh.faces) {
        double longest = 0, wish = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < 3; ++i) {
            const Vec3d& a = mesh.points[std::size_t(face.nodes[i])];
            longest = std::max(longest, glm::distance(a, mesh.points[std::size_t(face.nodes[(i + 1) % 3])]));
            wish = std::min(wish, size.at(a));
        }
        large += longest > kLarge * wish;
    }
    if (large > 0)
        warn(counted(large, "triangle") + " of the surface " + (large == 1 ? "has" : "have") +
             " edges of more than twice the length wished for, and so have the elements there; "
             "--boundary refine splits them.");
}

TetgenOutput Tetrahedralization::ofSurface() {
    if (options_.hullLimitWorld > 0)
        throw InputError(path_ + ": holds a surface; --hull-limit is for scattered points");
    checkSurface();
    takeSeeds();
    std::optional<SizeField> size;
    if (options_.size.any()) ofThisFile([&] { return &size.emplace(surface_, options_.size, execution_); });
    reportStage(Stage::tetrahedralizing);
    TetgenInput input;
    input.points = surface_.points;
    input.triangles = surface_.triangles;
    input.holesWorld = options_.holesWorld;
    input.regions = options_.regions;
    input.quality = options_.quality;
    input.minDihedralDegrees = options_.minDihedralDegrees;
    input.splitsBoundary = options_.splitsBoundary;
    input.size = size ? &*size : nullptr;
    TetgenOutput mesh = ofThisFile([&] { return runTetgen(input); });
    checkTriangles(mesh);
    if (size && !options_.splitsBoundary) warnOfLargeTriangles(*size, mesh);
    note("TetGen added " + counted(std::int64_t(mesh.points.size() - surface_.points.size()), "point") + ".");
    return mesh;
}

/// The values of the surface's points are theirs; on its triangles they are interpolated, inside extended.
void Tetrahedralization::carryFields(const TetgenOutput& mesh, TetMesh& carried) const {
    std::vector<char> isKnown(mesh.points.size());
    std::fill_n(isKnown.begin(), surface_.points.size(), char(1));
    for (const Field& field : surface_.fields) {
        carried.fields.push_back(field);
        carried.fields.back().values.resize(mesh.points.size() * std::size_t(field.components));
    }
    for (const TetgenOutput::Face& face : mesh.faces) {
        const auto& triangle = surface_.triangles[std::size_t(face.triangle)];
        const TriangleCorners corners = cornersOf(surface_, face.triangle);
        for (const std::int32_t node : face.nodes) {
            if (isKnown[std::size_t(node)]) continue;
            isKnown[std::size_t(node)] = 1;
            const TrianglePlace place = nearestOnTriangle(corners, mesh.points[std::size_t(node)]);
            for (Field& field : carried.fields)
                for (int c = 0; c < field.components; ++c) {
                    double& value =
                        field.values[std::size_t(node) * std::size_t(field.components) + std::size_t(c)];
                    for (std::size_t i = 0; i < 3; ++i)
                        if (place.weights[i] > 0) value += place.weights[i] * field.at(triangle[i], c);
                }
        }
    }
    carried.points = mesh.points;
    carried.tets = mesh.tets;
    extendFields(carried, isKnown);
}

RawBlock Tetrahedralization::blockOf(TetgenOutput mesh) {
    RawBlock block;
    for (const Field& field : surface_.fields)  // messages list all
        block.arrays.push_back({field.name, FieldLocation::point, field.components, true});
    std::erase_if(surface_.fields,
                  [&](const Field& field) { return !isWanted(read_, field.name, field.location); });
    if (surface_.triangles.empty()) {
        block.fields = std::move(surface_.fields);
    } else {
        TetMesh carried;
        carryFields(mesh, carried);
        block.fields = std::move(carried.fields);
    }
    block.points = std::move(mesh.points);
    if (!mesh.regions.empty() && *std::max_element(mesh.regions.begin(), mesh.regions.end()) >
                                     *std::min_element(mesh.regions.begin(), mesh.regions.end())) {
        block.fields.push_back({"region", FieldLocation::cell, 1, std::move(mesh.regions)});
        block.arrays.push_back({"region", FieldLocation::cell, 1, true});
        if (!read_.fields.empty()) read_.fields.push_back("region");
    }
    block.tets = std::move(mesh.tets);
    block.sourceCells = std::int64_t(block.tets.size());
    return block;
}

MeshFile Tetrahedralization::run() {
    readFile();
    RawMesh raw;
    const bool arePoints = surface_.triangles.empty();
    raw.blocks.push_back(blockOf(arePoints ? ofPoints() : ofSurface()));
    raw.statistics.format = file_.format + ", made into tetrahedra by TetGen 1.5";
    raw.statistics.warnings = file_.warnings;
    raw.statistics.notes = notes_;
    const std::int64_t points = std::int64_t(raw.blocks[0].points.size());
    MeshFile file = assembleMesh(path_, std::move(raw), read_, execution_);
    if (const std::int64_t lost = points - file.mesh.nodeCount(); lost > 0)
        file.statistics.warnings.push_back(
            counted(lost, "point") + " of no tetrahedron left out" +
            (options_.hullLimitWorld > 0 || !arePoints ? "." : ": too close to others for TetGen."));
    file.readPeakBytes = peakMemoryBytes();
    return file;
}

}  // namespace

ReaderTask tetrahedralizeTask() {
    const auto limits = [](const ReaderRequest& request) {
        IsolationLimits usual = defaultLimits(request.path, request.options);
        const TetrahedralizeOptions options = unpackOptions(request.body);
        const bool hasSizes = options.size.any() || !options.regions.empty();
        usual.memoryBytes = std::max(usual.memoryBytes, readingShare(defaultMemoryBytes()));
        usual.processorSeconds = kFloorSeconds + (hasSizes ? kSecondsForSizes : 0) +
                                 kSecondsPerByte * double(std::filesystem::file_size(request.path));
        usual.seconds = 10 * usual.processorSeconds;
        return usual;
    };
    return {kTetrahedralizeTask, limits,
            [](const ReaderRequest& request, const IsolationLimits&, const Execution& execution) {
                return packMesh(Tetrahedralization(request, execution).run());
            }};
}

}  // namespace tessera
