#include "hard_cases.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hard_meshes.h"
#include "mesh/element_class.h"
#include "reference/fields.h"
#include "reference/random.h"

namespace tessera::hard_cases {

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Four channels: linear, random, a small range on a large value, and which element it is.
TetMesh withFields(TetMesh mesh) {
    const Vec3d origin = mesh.points.empty() ? Vec3d(0) : mesh.points[0];
    addPointField(mesh, "linear", {[&](const Vec3d& p) {
                      const Vec3d q = p - origin;
                      return q.x + 2 * q.y - 3 * q.z;
                  }});
    addRandomField(mesh, "random", FieldLocation::point, 1, 0, 1, 61);
    addRandomField(mesh, "pressure", FieldLocation::point, 1, 101325, 1, 62);
    addElementIdField(mesh, "element");
    return mesh;
}

class Gallery {
  public:
    std::vector<HardCase> take() {
        for (HardCase& hardCase : cases_)
            if (!hardCase.isLarge) hardCase.make = contract::madeOnce(std::move(hardCase.make));
        return std::move(cases_);
    }

    /// The cases that follow stand in this row.
    Gallery& row(std::string name, std::string sentence) {
        row_ = std::move(name), sentence_ = std::move(sentence);
        return *this;
    }
    Gallery& bare(std::string name, std::function<TetMesh()> make) {
        cases_.push_back({std::move(name), row_, sentence_, std::move(make)});
        return *this;
    }
    Gallery& mesh(std::string name, const std::function<TetMesh()>& make) {
        return bare(std::move(name), [make] { return withFields(make()); });
    }
    /// Upright, then turned so that nothing lies along an axis.
    Gallery& bothWays(const std::string& name, const std::function<TetMesh()>& make) {
        mesh(name, make);
        return mesh("Turned" + name, [make] {
            TetMesh turned = make();
            place(turned, {1, {}, true});
            return turned;
        });
    }
    HardCase& last() { return cases_.back(); }

  private:
    std::vector<HardCase> cases_;
    std::string row_, sentence_;
};

void addThinElements(Gallery& gallery) {
    constexpr struct {
        ThinKind kind;
        const char *plural, *title, *shape;
    } kKinds[] = {
        {ThinKind::needle, "needles", "Needles", "a small triangle and a node far away"},
        {ThinKind::spindle, "spindles", "Spindles",
         "two short edges far from each other, or a node beside an edge"},
        {ThinKind::sliver, "slivers", "Slivers", "four nodes around a nearly flat square"},
        {ThinKind::cap, "caps", "Caps", "a node close above the middle of a triangle"},
    };
    constexpr int kExponents[] = {2, 4, 6, 9, 12};
    const std::string range = ", aspect ratio 1e-2 to 1e-12";
    for (const auto& [kind, plural, title, shape] : kKinds) {
        const auto seed = std::uint64_t(kind) * 100 + 7;
        const auto each = [&, kind = kind, title = title](const char* suffix, const auto& make) {
            for (const int exponent : kExponents)
                gallery.mesh(title + std::string(suffix) + "1e" + std::to_string(exponent),
                             [make, kind, exponent, seed] {
                                 return make(kind, tenToMinus(exponent), seed + std::uint64_t(exponent));
                             });
        };
        gallery.row(std::string(plural) + " alone", shape + range + "; each on its own");
        each("Alone", [](ThinKind k, double aspect, std::uint64_t s) { return thinAlone(k, aspect, 12, s); });
        gallery.row(std::string(plural) + " in a cluster", "elements of that shape share faces" + range);
        each("InACluster",
             [](ThinKind k, double aspect, std::uint64_t s) { return thinChain(k, aspect, 40, s); });
        gallery.row(std::string(plural) + " in a good mesh",
                    "between well-shaped neighbours, conforming" + range);
        each("InAGoodMesh",
             [](ThinKind k, double aspect, std::uint64_t) { return thinInsideGoodMesh(k, aspect); });
    }
    gallery.row("squeezed meshes", "a Delaunay mesh squeezed along one axis or two, so that all is thin");
    for (const int exponent : {3, 8}) {
        gallery.mesh("SqueezedOnce1e" + std::to_string(exponent),
                     [exponent] { return thinClusterMesh(tenToMinus(exponent), 1, 80, 11); });
        gallery.mesh("SqueezedTwice1e" + std::to_string(exponent),
                     [exponent] { return thinClusterMesh(tenToMinus(exponent), 2, 80, 13); });
    }
}

void addFlatElementCases(Gallery& gallery) {
    gallery.row("zero volume only", "elements that are no part of the mesh: nothing is covered");
    gallery.mesh("Coplanar", [] { return flatElements(FlatKind::coplanar, 20, 1); });
    gallery.mesh("Collinear", [] { return flatElements(FlatKind::collinear, 20, 2); });
    gallery.mesh("RepeatedNode", [] { return flatElements(FlatKind::repeatedNode, 20, 3); });
    gallery.mesh("CoincidentNodes", [] { return flatElements(FlatKind::coincidentNodes, 20, 4); });
    gallery.mesh("AllNodesEqual", [] { return flatElements(FlatKind::allNodesEqual, 3, 5); });
    gallery.row("zero volume in a mesh", "flat elements of every kind between nodes of good ones");
    gallery.bothWays("FlatElementsAdded", [] {
        TetMesh mesh = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
        addFlatElements(mesh);
        return mesh;
    });
    gallery.row("inverted elements", "all of negative orientation, or a mix of both");
    gallery.mesh("AllInverted", [] {
        TetMesh mesh = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
        for (auto& tet : mesh.tets) std::swap(tet[0], tet[1]);
        return mesh;
    });
    gallery.mesh("BothOrientations", [] {
        TetMesh mesh = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
        addFlatElements(mesh);
        invertEverySecond(mesh);
        return mesh;
    });
}

void addAlignedMeshes(Gallery& gallery) {
    gallery.row("nodes, edges and faces on the lattice",
                "a spacing that divides the mesh exactly, or all but in rounding (thirds)");
    gallery.mesh("BoxOfKuhnTets", [] { return boxMesh({.cells = {4, 4, 4}}); });
    gallery.mesh("BoxOfFiveTetsACell", [] { return boxMesh({.cells = {4, 4, 4}, .isFiveSplit = true}); });
    gallery.mesh("BoxOfThirds", [] { return boxMesh({.cells = {3, 3, 3}, .originWorld = {0.1, 0.2, 0.3}}); });
    gallery.mesh("IntegerNodes", [] { return integerTetsMesh(5, 3, 21); });
    gallery.mesh("IntegerNodesFarFromZero", [] {
        TetMesh mesh = integerTetsMesh(7, 2, 22);
        place(mesh, {1, Vec3d(-1024, 4096, 1 << 20), false});
        return mesh;
    });
}

void addSizes(Gallery& gallery) {
    gallery.row("a million elements in one voxel", "and the elements around them, far larger");
    gallery.mesh("CrowdedVoxel", [] { return crowdedVoxel(1000000, 31); });
    gallery.last().isLarge = true;
    gallery.row("dust beside elements that span everything",
                "3,000 elements of a thousandth of a voxel on a box of six");
    gallery.bothWays("DustInOneBox", [] {
        TetMesh mesh = boxMesh({.cells = {1, 1, 1}});
        appendMesh(mesh, dustMesh(Vec3d(1.0, 0.5, 0.5), 0.01, 1e-5, 3000, 32));
        return mesh;
    });
    gallery.row("volumes from 1 to 1e-18", "a chain of boxes, each a tenth of the last one's length");
    gallery.bothWays("ShrinkingBoxes", shrinkingBoxes);
    gallery.row("coordinates of 1e-9, 1 and 1e9", "the same mesh in other units");
    for (const auto& [name, scale] : {std::pair{"Nanometres", 1e-9}, {"Metres", 1.0}, {"Gigametres", 1e9}})
        gallery.mesh(name, [scale = scale] {
            TetMesh mesh = boxMesh({.cells = {4, 4, 4}, .jitter = 0.25, .seed = 33});
            place(mesh, {scale, {}, true});
            return mesh;
        });
    gallery.row("a unit mesh 1e6 and 1e12 from the origin", "few bits are left for the mesh itself");
    for (const auto& [name, offset] : {std::pair{"AtAMillion", 1e6}, {"AtATrillion", 1e12}}) {
        gallery.mesh(name, [offset = offset] {
            TetMesh mesh = boxMesh({.cells = {4, 4, 4}, .jitter = 0.25, .seed = 34});
            place(mesh, {1, Vec3d(offset, -offset, 0.5 * offset), true});
            return mesh;
        });
        gallery.mesh(std::string("Aligned") + name, [offset = offset] {
            return boxMesh({.cells = {4, 4, 4}, .originWorld = Vec3d(offset)});
        });
    }
    gallery.row("boundary layers of 1e5 to 1", "elements far thinner than wide, in growing layers");
    gallery.bothWays("BoundaryLayers", [] { return boundaryLayerMesh(3, 1e-5); });
}

void addTopologies(Gallery& gallery) {
    gallery.row("T-junctions", "nodes hang on faces and edges of larger elements");
    gallery.bothWays("HangingNodes", [] { return hangingNodeMesh(2, 3); });
    gallery.mesh("HangingNodesOnTheLattice", [] { return hangingNodeMesh(1, 4); });
    gallery.row("overlapping elements", "several elements cover a point");
    gallery.mesh("Overlapping", [] { return overlappingMesh(40, 41); });
    gallery.mesh("TwiceTheSame", [] {
        TetMesh mesh = boxMesh({.cells = {2, 2, 2}, .jitter = 0.2});
        appendMesh(mesh, TetMesh(mesh));
        return mesh;
    });
    gallery.row("disconnected parts", "two touch in a node, two nowhere");
    gallery.bothWays("DisconnectedParts", disconnectedParts);
    gallery.row("an interior void", "a box without its middle");
    gallery.mesh("BoxWithVoid", boxWithVoid);
    gallery.row("one element", "the smallest mesh there is");
    gallery.bothWays("OneElement", oneElement);
    gallery.row("one element thick", "plates of half a voxel, and far thinner than one");
    for (const auto& [name, thickness] : {std::pair{"ThinPlate", 0x1p-5}, {"FarThinnerPlate", 1e-5}})
        gallery.bothWays(name, [thickness = thickness] {
            return boxMesh({.cells = {6, 5, 1}, .sizeWorld = {1, 1, thickness}});
        });
    gallery.row("curved and graded", "a ball; a Delaunay mesh of random nodes");
    gallery.mesh("Ball", [] { return sphereMesh(5); });
    gallery.mesh("Delaunay", [] { return gradedDelaunayMesh(300, 1, 43); });
}

/// Well-shaped elements and a chain of slivers beside them.
TetMesh fieldMesh() {
    TetMesh mesh = boxMesh({.cells = {4, 4, 4}, .jitter = 0.25, .seed = 51});
    appendMesh(mesh, thinChain(ThinKind::sliver, tenToMinus(4), 30, 52));
    return mesh;
}

TetMesh withSingleValues(double value) {
    TetMesh mesh = fieldMesh();
    addRandomField(mesh, "random", FieldLocation::point, 1, 1, 1, 53);
    addRandomField(mesh, "cells", FieldLocation::cell, 1, 1, 1, 54);
    mesh.fields[0].values[62] = value, mesh.fields[0].values[7] = -value;
    mesh.fields[1].values[100] = value, mesh.fields[1].values[9] = -value;
    return mesh;
}

void addFieldCases(Gallery& gallery) {
    gallery.row("constant fields", "a range of zero: the value comes back exactly");
    for (const auto& [name, value] : {std::pair{"Constant", 0.1},
                                      {"ConstantZero", 0.0},
                                      {"ConstantHuge", 1e30},
                                      {"ConstantTiny", -1e-30},
                                      {"ConstantPressure", 101325.7}}) {
        gallery.bare(name, [value = value] {
            TetMesh mesh = fieldMesh();
            addPointField(mesh, "nodes", {[value](const Vec3d&) { return value; }});
            addCellField(mesh, "cells", {[value](const Vec3d&) { return value; }});
            return mesh;
        });
        gallery.last().isConstant = true;
    }
    const auto random = [&](const char* name, double offset, double scale) {
        gallery.bare(name, [offset, scale] {
            TetMesh mesh = fieldMesh();
            addRandomField(mesh, "nodes", FieldLocation::point, 1, offset, scale, 55);
            addRandomField(mesh, "cells", FieldLocation::cell, 1, offset, scale, 56);
            return mesh;
        });
    };
    gallery.row("values of 1e30 and 1e-30", "products of them leave the range of float");
    random("HugeValues", 0, 1e30);
    random("TinyValues", 0, 1e-30);
    random("DenormalValues", 0, 1e-41);
    gallery.row("a tiny range on a large value",
                "101325 +- 1, and +- 1e-3, which is below the step of a float");
    random("PressureRange1", 101325, 1);
    random("PressureRange1e3", 101325, 1e-3);
    gallery.row("a linear field", "three components");
    gallery.bare("LinearField", [] {
        TetMesh mesh = fieldMesh();
        addPointField(
            mesh, "linear",
            {[](const Vec3d& p) { return p.x; }, [](const Vec3d& p) { return 3 * p.y - 2 * p.z + 1; },
             [](const Vec3d& p) { return 1e6 * (p.x + p.y + p.z); }});
        return mesh;
    });
    gallery.row("NaN and infinity at single nodes",
                "their elements are covered, not valid; others keep their values");
    gallery.bare("NanAtSingleNodes", [] { return withSingleValues(kNan); });
    gallery.bare("InfinityAtSingleNodes", [] { return withSingleValues(kInfinity); });
    gallery.bare("BeyondFloatAtSingleNodes", [] { return withSingleValues(1e300); });
    gallery.row("cell data that jumps on shared faces",
                "faces on lattice points: one element owns each point");
    gallery.bare("JumpingCellData", [] {
        TetMesh mesh = boxMesh({.cells = {4, 4, 4}});
        addRandomField(mesh, "cells", FieldLocation::cell, 2, 0, 1e6, 57);
        addElementIdField(mesh, "element");
        return mesh;
    });
}

}  // namespace

const std::vector<HardCase>& hardCases() {
    static const std::vector<HardCase> cases = [] {
        Gallery gallery;
        addThinElements(gallery);
        addFlatElementCases(gallery);
        addAlignedMeshes(gallery);
        addSizes(gallery);
        addTopologies(gallery);
        addFieldCases(gallery);
        return gallery.take();
    }();
    return cases;
}

std::vector<contract::LatticeCase> latticesOf(const TetMesh& mesh, int cells) {
    const Vec3d size = mesh.boundsWorld().size();
    const double longest = std::max({size.x, size.y, size.z});
    contract::LatticeCase aligned;
    if (longest > 0)
        aligned = contract::latticeOver(mesh, cells + 1);
    else
        aligned = {"point", Lattice::axisParallel(mesh.points[0], 1), {Vec3i(-1), Vec3i(2)}};
    aligned.name = std::to_string(cells) + " aligned";
    const auto shifted = [&](const char* name, const Vec3d& steps) {
        contract::LatticeCase at = aligned;
        at.name = std::to_string(cells) + name;
        at.lattice.originWorld -= steps * aligned.lattice.uWorld.x;
        at.box.max += 1;
        return at;
    };
    const contract::LatticeCase third = shifted(" third off", Vec3d(1.0 / 3, 1.0 / 7, 2.0 / 3));
    if (cells >= 128) return {third};
    if (cells >= 64) return {aligned};
    return {aligned, shifted(" half off", Vec3d(0.5)), third};
}

std::vector<contract::LatticeCase> latticesThroughThinnest(const TetMesh& mesh, int count) {
    std::vector<std::pair<double, std::int64_t>> byAspect;
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e)
        byAspect.emplace_back(aspectOf(cornersOf(mesh, e)), e);
    std::sort(byAspect.begin(), byAspect.end());
    const Vec3d size = mesh.boundsWorld().size();
    const double spacing = std::max({size.x, size.y, size.z}) / 16;
    std::vector<contract::LatticeCase> lattices;
    for (const auto& [aspect, element] : byAspect) {
        if (std::int64_t(lattices.size()) == count) break;
        Vec3d centroid(0);
        for (const auto node : mesh.tets[std::size_t(element)])
            centroid += mesh.points[std::size_t(node)] * 0.25;
        contract::LatticeCase at{"through element " + std::to_string(element),
                                 Lattice::axisParallel(centroid, spacing),
                                 {Vec3i(-3), Vec3i(4)}};
        const Oracle oracle(mesh, at.lattice);
        if (oracle.volumeSign(element) != 0 && oracle.contains(element, Vec3i(0)))
            lattices.push_back(std::move(at));
    }
    return lattices;
}

std::int64_t wrongConstants(const TetMesh& mesh, const Block& block) {
    std::int64_t wrong = 0;
    int channel = 0;
    for (const Field& field : mesh.fields)
        for (int c = 0; c < field.components; ++c, ++channel) {
            const float expected = float(field.values[std::size_t(c)]);
            const auto values = block.channel(channel);
            for (std::size_t i = 0; i < block.count(); ++i)
                wrong += block.coverage[i] != 0 && values[i] != expected;
        }
    return wrong;
}

}  // namespace tessera::hard_cases
