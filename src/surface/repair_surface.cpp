#include "surface/repair_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "mesh/mesh_quality.h"
#include "surface/keep_points.h"
#include "surface/shell_nest.h"
#include "surface/surface_edges.h"
#include "surface/unfit_triangles.h"

namespace tessera {

namespace {

std::int64_t removeMarked(Surface& surface, const std::vector<std::uint8_t>& marked) {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t)
        if (!marked[t]) surface.triangles[kept++] = surface.triangles[t];
    const auto removed = std::int64_t(surface.triangles.size() - kept);
    surface.triangles.resize(kept);
    return removed;
}

void turn(std::array<std::int32_t, 3>& triangle) {
    std::swap(triangle[1], triangle[2]);
}

/// Of every part 1 when it is a closed shell that looks inwards and is to look outwards.
std::vector<std::uint8_t> findInwardParts(const Surface& surface, const SurfaceParts& found,
                                          std::span<const std::uint8_t> leftOut, Outwards outwards,
                                          const Execution& execution) {
    std::vector<std::int32_t> shellOfPart(found.parts.size(), -1), partOfShell;
    for (std::size_t p = 0; p < found.parts.size(); ++p)
        if (found.parts[p].closed && found.parts[p].orientable) {
            shellOfPart[p] = std::int32_t(partOfShell.size());
            partOfShell.push_back(std::int32_t(p));
        }
    std::vector<std::int32_t> shellOf(surface.triangles.size(), -1);
    for (std::size_t t = 0; t < shellOf.size(); ++t) shellOf[t] = shellOfPart[std::size_t(found.partOf[t])];
    const TriangleTree tree(surface, leftOut, execution);
    const ShellNest nest(tree, shellOf, partOfShell.size(), execution);
    const std::vector<double> volumes = nest.volumesWorld(execution);
    const auto around = nest.shellsAround(execution);
    std::vector<std::uint8_t> inward(found.parts.size(), 0);
    for (std::size_t s = 0; s < partOfShell.size(); ++s)
        inward[std::size_t(partOfShell[s])] =
            (around[s].empty() || outwards == Outwards::all) && volumes[s] < 0;
    return inward;
}

/// Gives the first point of every place the mean of the finite values there. Equal values stay as they are,
/// bit for bit, and so does the first where none is finite. @param first the first point at every point's
/// place.
void takeMeans(std::span<const std::int32_t> first, int component, Field& field) {
    const auto at = [&](std::size_t p) -> double& {
        return field.values[p * std::size_t(field.components) + std::size_t(component)];
    };
    std::vector<double> differences(first.size());
    std::vector<std::int32_t> counts(first.size());
    for (std::size_t p = 0; p < first.size(); ++p) {
        const auto place = std::size_t(first[p]);
        if (!std::isfinite(at(p))) continue;
        if (counts[place] == 0) at(place) = at(p);
        differences[place] += at(p) - at(place);
        ++counts[place];
    }
    for (std::size_t p = 0; p < first.size(); ++p)
        if (counts[p] > 1) at(p) += differences[p] / counts[p];
}

}  // namespace

std::int64_t mergePoints(Surface& surface, const Execution& execution) {
    const std::vector<std::int32_t> first = firstNodeAtPlace(surface.points, execution);
    for (Field& field : surface.fields)
        for (int c = 0; c < field.components; ++c) takeMeans(first, c, field);
    for (auto& triangle : surface.triangles)
        for (std::int32_t& corner : triangle) corner = first[std::size_t(corner)];
    std::vector<char> isFirst(first.size());
    for (std::size_t p = 0; p < first.size(); ++p) isFirst[p] = std::size_t(first[p]) == p;
    keepPoints(isFirst, surface);
    return std::int64_t(first.size() - surface.points.size());
}

std::int64_t turnTriangles(Surface& surface, Outwards outwards, const Execution& execution) {
    // Triangles without area count here: they too have neighbours over their edges.
    const std::vector<std::uint8_t> none(surface.triangles.size(), 0);
    SurfaceParts found = findParts(surface, edgeUses(surface, none), none);
    for (std::size_t t = 0; t < found.turned.size(); ++t) {
        if (!found.parts[std::size_t(found.partOf[t])].orientable) found.turned[t] = 0;
        if (found.turned[t]) turn(surface.triangles[t]);
    }
    const std::vector<std::uint8_t> inward = findInwardParts(surface, found, none, outwards, execution);
    std::int64_t turned = 0;
    for (std::size_t t = 0; t < found.turned.size(); ++t) {
        const std::uint8_t isInward = inward[std::size_t(found.partOf[t])];
        if (isInward) turn(surface.triangles[t]);
        turned += found.turned[t] != isInward;
    }
    return turned;
}

SurfaceRepair repairSurface(Surface& surface, const Execution& execution) {
    SurfaceRepair repair;
    repair.mergedPoints = mergePoints(surface, execution);
    repair.removedTriangles = removeMarked(surface, trianglesWithCornerTwice(surface));
    const std::vector<std::uint8_t> none(surface.triangles.size(), 0);
    repair.removedTriangles += removeMarked(surface, laterDuplicates(surface, none));
    repair.turnedTriangles = turnTriangles(surface, Outwards::outermost, execution);
    return repair;
}

}  // namespace tessera
