#include "tetgen/run_tetgen.h"

#define TETLIBRARY
#include <tetgen.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <new>
#include <string>

#include "mesh/geometry.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Elements are split when their longest edge is above so many times the length wished for: then the mean of
/// all edges is 0.9 to 1.1 of that length (measured in balls, boxes and tori), less where the surface's
/// triangles are smaller.
constexpr double kLongestOverMean = 1.45;
/// The largest volume of an element in a region, in cubes of the length wished for: means of 0.87 to 0.97.
constexpr double kVolumeOfCube = 0.17;

/// TetGen's callback has no argument of the caller's.
const SizeField* wishedSize = nullptr;
double worldFromScaled = 1;

bool isTooLarge(double* a, double* b, double* c, double* d, double*, double) {
    const std::array<const double*, 4> corners{a, b, c, d};
    std::array<Vec3d, 4> places;
    for (std::size_t i = 0; i < 4; ++i)
        places[i] = worldFromScaled * Vec3d(corners[i][0], corners[i][1], corners[i][2]);
    double longest2 = 0;
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < i; ++j) {
            const Vec3d edge = places[i] - places[j];
            longest2 = std::max(longest2, glm::dot(edge, edge));
        }
    const double wanted = std::sqrt(longest2) / kLongestOverMean;
    if (!(wanted > wishedSize->least())) return false;
    return std::any_of(places.begin(), places.end(),
                       [&](const Vec3d& place) { return wanted > wishedSize->at(place); });
}

/// The power of two that brings the largest coordinate to about 1: without rounding, and TetGen's products of
/// five coordinates neither overflow nor vanish.
int exponentOf(std::span<const Vec3d> points) {
    double largest = 0;
    for (const Vec3d& p : points) largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    int exponent = 0;
    std::frexp(largest, &exponent);
    return exponent;
}

double* scaled(std::span<const Vec3d> places, int exponent) {
    auto* numbers = new double[3 * places.size()];
    for (std::size_t p = 0; p < places.size(); ++p)
        for (int k = 0; k < 3; ++k) numbers[3 * p + std::size_t(k)] = std::ldexp(places[p][k], -exponent);
    return numbers;
}

void addFacets(std::span<const std::array<std::int32_t, 3>> triangles, tetgenio& in) {
    in.numberoffacets = int(triangles.size());
    in.facetlist = new tetgenio::facet[triangles.size()];
    in.facetmarkerlist = new int[triangles.size()];
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        tetgenio::facet& facet = in.facetlist[t];
        facet.polygonlist = new tetgenio::polygon[1];
        facet.numberofpolygons = 1;
        facet.holelist = nullptr;
        facet.numberofholes = 0;
        facet.polygonlist[0].vertexlist = new int[3];
        facet.polygonlist[0].numberofvertices = 3;
        std::copy(triangles[t].begin(), triangles[t].end(), facet.polygonlist[0].vertexlist);
        in.facetmarkerlist[t] = int(t) + 1;
    }
}

void addSeeds(const TetgenInput& input, int exponent, tetgenio& in) {
    in.numberofholes = int(input.holesWorld.size());
    if (in.numberofholes > 0) in.holelist = scaled(input.holesWorld, exponent);
    in.numberofregions = int(input.regions.size());
    if (in.numberofregions == 0) return;
    in.regionlist = new double[5 * input.regions.size()];
    double* next = in.regionlist;
    for (std::size_t r = 0; r < input.regions.size(); ++r) {
        for (int k = 0; k < 3; ++k) *next++ = std::ldexp(input.regions[r].placeWorld[k], -exponent);
        *next++ = double(r) + 1;
        const double edge = std::ldexp(input.regions[r].sizeWorld, -exponent);
        *next++ = edge > 0 ? kVolumeOfCube * edge * edge * edge : -1;
    }
}

std::string switchesOf(const TetgenInput& input) {
    if (input.triangles.empty()) return "QJT1e-14";
    char text[96];
    std::snprintf(text, sizeof text, "pQJAq%.6f/%.6f", input.quality, input.minDihedralDegrees);
    std::string switches = text;
    if (!input.splitsBoundary) switches += 'Y';
    if (std::any_of(input.regions.begin(), input.regions.end(),
                    [](const RegionSeed& seed) { return seed.sizeWorld > 0; }))
        switches += 'a';
    return switches;
}

[[noreturn]] void explain(int code) {
    switch (code) {
        case 1:
            throw std::bad_alloc();
        case 3:
            throw InputError("TetGen finds that the surface crosses itself, within its tolerance");
        case 4:
            throw InputError(
                "TetGen finds details of the surface that are too small: parts that don't touch lie closer "
                "than "
                "about 1e-8 of its size");
        case 5:
            throw InputError("TetGen finds that two facets of the surface lie almost upon each other");
        default:
            throw InputError("TetGen gave up, with its error " + std::to_string(code));
    }
}

TetgenOutput outputOf(const TetgenInput& input, const tetgenio& out, int exponent) {
    TetgenOutput result;
    result.points.assign(input.points.begin(), input.points.end());  // exactly as they were
    for (auto p = input.points.size(); p < std::size_t(out.numberofpoints); ++p) {
        Vec3d& place = result.points.emplace_back(0.0);
        for (int k = 0; k < 3; ++k) place[k] = std::ldexp(out.pointlist[3 * p + std::size_t(k)], exponent);
    }
    result.tets.resize(std::size_t(out.numberoftetrahedra));
    for (std::size_t e = 0; e < result.tets.size(); ++e) {
        auto& tet = result.tets[e];
        std::copy_n(out.tetrahedronlist + e * std::size_t(out.numberofcorners), 4, tet.begin());
        const auto at = [&](std::size_t i) -> const Vec3d& { return result.points[std::size_t(tet[i])]; };
        if (volumeSign(at(0), at(1), at(2), at(3)) < 0) std::swap(tet[2], tet[3]);
    }
    if (out.numberoftetrahedronattributes > 0)
        for (std::size_t e = 0; e < result.tets.size(); ++e)
            result.regions.push_back(
                out.tetrahedronattributelist[e * std::size_t(out.numberoftetrahedronattributes)]);
    if (!input.triangles.empty() && out.trifacemarkerlist) {
        for (std::size_t f = 0; f < std::size_t(out.numberoftrifaces); ++f) {
            const int marker = out.trifacemarkerlist[f];
            if (marker < 1 || marker > int(input.triangles.size())) continue;
            const int* nodes = out.trifacelist + 3 * f;
            result.faces.push_back({{nodes[0], nodes[1], nodes[2]}, marker - 1});
        }
    }
    return result;
}

}  // namespace

TetgenOutput runTetgen(const TetgenInput& input) {
    if (input.points.size() > std::size_t(std::numeric_limits<int>::max() / 8))
        throw InputError("more points than TetGen can count");
    const int exponent = exponentOf(input.points);
    tetgenio in, out;
    in.numberofpoints = int(input.points.size());
    in.pointlist = scaled(input.points, exponent);
    if (!input.triangles.empty()) {
        addFacets(input.triangles, in);
        addSeeds(input, exponent, in);
    }
    wishedSize = input.size;
    worldFromScaled = std::ldexp(1.0, exponent);
    if (wishedSize) in.tetunsuitable = isTooLarge;
    std::string switches = switchesOf(input);
    try {
        tetrahedralize(switches.data(), &in, &out);
    } catch (int code) {
        explain(code);
    }
    return outputOf(input, out, exponent);
}

}  // namespace tessera
