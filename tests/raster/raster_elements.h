#pragma once

#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <span>
#include <string_view>
#include <vector>

#include "raster/prepared_region.h"
#include "reference/random.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

// Random elements that are hard on rasterisers, for the tests of the OpenGL resamplers' core. They have
// nothing to do with one another: each is a mesh of its own in the same list.

namespace tessera::rastertest {

enum class Zoo {
    plain,         ///< nodes at random
    thin,          ///< about a plane or a line, as thin as 2^-45 of their size
    anchored,      ///< a lattice point exactly on a node, an edge or a face, and thin
    inSlicePlane,  ///< a face or an edge in a lattice plane, exactly or within 2^-10 to 2^-50 voxel
    flatInSlice,   ///< thinner than 2^-20 voxel along one axis, about a lattice plane
    whole,         ///< all nodes on lattice points
};
inline constexpr Zoo kZoo[] = {Zoo::plain,        Zoo::thin,        Zoo::anchored,
                               Zoo::inSlicePlane, Zoo::flatInSlice, Zoo::whole};
inline std::string_view nameOf(Zoo zoo) {
    constexpr std::string_view names[] = {"plain",        "thin",        "anchored",
                                          "inSlicePlane", "flatInSlice", "whole"};
    return names[int(zoo)];
}

class ElementMaker {
  public:
    /// Elements of up to `size` voxels that meet the box `low`..`high`; places are relative to it.
    ElementMaker(std::uint64_t seed, double size, const Vec3d& low, const Vec3d& high)
        : random_(seed), size_(size), low_(low), high_(high) {}

    std::array<Vec3d, 4> make(Zoo zoo) {
        std::array<Vec3d, 4> nodes = general();
        switch (zoo) {
            case Zoo::plain:
                break;
            case Zoo::thin:
                squeeze(nodes);
                break;
            case Zoo::anchored:
                squeeze(nodes);
                anchor(nodes);
                break;
            case Zoo::inSlicePlane:
                layInPlane(nodes);
                break;
            case Zoo::flatInSlice:
                flatten(nodes);
                break;
            case Zoo::whole:
                for (Vec3d& node : nodes) node = glm::round(node);
                break;
        }
        const int turn = random_.below(24);
        for (int k = 3; k > 0; --k)
            std::swap(nodes[std::size_t(k)], nodes[std::size_t((turn >> k) % (k + 1))]);
        return nodes;
    }

  private:
    /// Between 1 and 2^-range, evenly over the powers.
    double small(double range) { return std::exp2(-range * random_.unit()); }
    /// A vector of few binary digits, so that sums of them are exact.
    Vec3d dyadic(double scale) { return glm::round(random_.offset() * 0x1p12) * 0x1p-12 * scale; }
    Vec3d placeInBox() { return low_ + random_.place() * (high_ - low_); }

    std::array<Vec3d, 4> general() {
        const Vec3d centre = placeInBox();
        const double size = random_.below(3) ? size_ * (0.2 + 0.8 * random_.unit()) : size_ * small(8);
        std::array<Vec3d, 4> nodes;
        for (Vec3d& node : nodes) node = centre + 0.5 * size * random_.offset();
        return nodes;
    }

    /// Towards a plane through three nodes, a line through two, or both.
    void squeeze(std::array<Vec3d, 4>& nodes) {
        const double thin = small(45);
        const int kind = random_.below(4);
        const Vec3d along = nodes[1] - nodes[0];
        if (kind == 0) {  // sliver or cap: a node over a place in the opposite face's plane
            const double a = 1.6 * random_.unit() - 0.3, b = (1 - a) * random_.unit();
            const Vec3d foot = nodes[0] + a * along + b * (nodes[2] - nodes[0]);
            nodes[3] = foot + thin * (nodes[3] - foot);
        } else if (kind == 1) {  // needle: three nodes about one end
            for (const std::size_t k : {2u, 3u}) nodes[k] = nodes[0] + thin * (nodes[k] - nodes[0]);
        } else {  // spindle: an edge across the middle; or two short edges at the ends
            const Vec3d middle = nodes[0] + random_.unit() * along;
            nodes[2] = (kind == 2 ? middle : nodes[0]) + thin * (nodes[2] - nodes[0]);
            nodes[3] = (kind == 2 ? middle : nodes[1]) + thin * (nodes[3] - nodes[1]);
        }
    }

    void anchor(std::array<Vec3d, 4>& nodes) {
        const Vec3d point = glm::round(placeInBox());
        const double scale = size_ * std::exp2(-double(random_.below(6)));
        const Vec3d move = point - nodes[0];
        for (Vec3d& node : nodes) node += move;
        nodes[0] = point;
        const int kind = random_.below(3);
        if (kind == 0) return;
        const Vec3d across = dyadic(0.5 * scale), other = dyadic(0.25 * scale);
        if (kind == 1) {  // the middle of an edge, or its quarter
            nodes[0] = point - across;
            nodes[1] = point + across * (random_.below(2) ? 1.0 : 3.0);
        } else {  // the centre of a face
            nodes[0] = point + across;
            nodes[1] = point + other;
            nodes[2] = point - (across + other);
        }
    }

    void layInPlane(std::array<Vec3d, 4>& nodes) {
        const int axis = random_.below(3), count = 2 + random_.below(2);
        const double plane = std::round(placeInBox()[axis]);
        for (int k = 0; k < count; ++k) {
            const double off = random_.below(2) ? 0.0 : std::exp2(-10 - 40 * random_.unit());
            nodes[std::size_t(k)][axis] = plane + (random_.below(2) ? off : -off);
        }
        if (random_.below(2)) nodes[3][axis] = plane + (nodes[3][axis] - plane) * small(30);
    }

    void flatten(std::array<Vec3d, 4>& nodes) {
        const int axis = random_.below(3);
        const double plane = std::round(placeInBox()[axis]);
        const double thin = std::exp2(-20 - 20 * random_.unit());
        for (Vec3d& node : nodes) node[axis] = plane + thin * random_.centred();
        if (random_.below(2)) nodes[std::size_t(random_.below(4))][axis] = plane;
    }

    Random random_;
    double size_;
    Vec3d low_, high_;
};

/// A mesh of `count` unconnected elements of one kind.
inline TetMesh zooMesh(Zoo zoo, int count, std::uint64_t seed, double size, const Vec3d& low,
                       const Vec3d& high) {
    ElementMaker maker(seed, size, low, high);
    TetMesh mesh;
    for (int i = 0; i < count; ++i) {
        const auto n = std::int32_t(mesh.points.size());
        for (const Vec3d& node : maker.make(zoo)) mesh.points.push_back(node);
        mesh.tets.push_back({n, n + 1, n + 2, n + 3});
    }
    return mesh;
}

/// A prepared region whose elements are known by number: they carry it as their one channel.
class NumberedRegion {
  public:
    NumberedRegion(const TetMesh& mesh, const NodeFrame& frame, const IndexBox& box, const SliceAxes& axes)
        : numbers_{"number", FieldLocation::cell, 1, std::vector<double>(mesh.tets.size())},
          slices_(mesh.tets.size(), nullptr),
          isHard_(mesh.tets.size(), 0) {
        std::iota(numbers_.values.begin(), numbers_.values.end(), 0.0);
        std::vector<std::int32_t> elements(mesh.tets.size());
        std::iota(elements.begin(), elements.end(), 0);
        const ChannelCoding coding(numbers_, 0, SampleFormat::r32f);
        const RasterInputs inputs{mesh, frame, std::span(&coding, 1), SampleFormat::r32f, axes};
        region_ = prepareRegion(inputs, box, elements, {.threads = 1});
        for (const SliceElement& e : region_.elements) {
            const auto& channels =
                e.grade == ShapeGrade::easy ? region_.easy.channels[0] : region_.thin.channels[0];
            slices_.at(std::size_t(coding.decode(channels.at(e.record).value))) = &e;
        }
        for (const std::int32_t element : region_.hard) isHard_[std::size_t(element)] = 1;
    }
    NumberedRegion(const NumberedRegion&) = delete;

    const PreparedRegion& region() const { return region_; }
    /// Null when the element has no record.
    const SliceElement* find(std::int32_t element) const { return slices_[std::size_t(element)]; }
    bool isHard(std::int32_t element) const { return isHard_[std::size_t(element)] != 0; }

  private:
    Field numbers_;
    PreparedRegion region_;
    std::vector<const SliceElement*> slices_;
    std::vector<char> isHard_;
};

/// Least distance to a face in the order of element_fragment.glsl. @param p relative to the region.
template <class Geometry>
double leastDistance(const Geometry& geometry, const Vec3i& p) {
    using Real = std::remove_cvref_t<decltype(geometry.offset[0])>;
    Real place[3], least = std::numeric_limits<Real>::infinity();
    for (int a = 0; a < 3; ++a) place[a] = Real(float(p[a]) - geometry.base[a]);
    for (int face = 0; face < 4; ++face) {
        const Real x = geometry.normal[0][face] * place[0], y = geometry.normal[1][face] * place[1],
                   z = geometry.normal[2][face] * place[2];
        least = std::min(least, ((x + y) + z) + geometry.offset[face]);
    }
    return double(least);
}

/// What a fragment finds and compares: it is accepted unless the least distance is below -slack.
struct Fragment {
    double least, slack;
    bool isAccepted() const { return !(least < -slack); }
};
/// @param p relative to the region.
inline Fragment fragmentOf(const PreparedRegion& region, const SliceElement& slice, const Vec3i& p) {
    if (slice.grade == ShapeGrade::easy) {
        const EasyGeometry& geometry = region.easy.geometry[slice.record];
        return {leastDistance(geometry, p), double(geometry.slack)};
    }
    const ThinGeometry& geometry = region.thin.geometry[slice.record];
    return {leastDistance(geometry, p), double(geometry.slack)};
}

/// TESSERA_SLAB_ROUNDS asks for more random elements than a test run has time for.
inline int rounds(int usual) {
    const char* text = std::getenv("TESSERA_SLAB_ROUNDS");
    return usual * std::max(1, text ? std::atoi(text) : 1);
}

}  // namespace tessera::rastertest
