// Input: a letter for the format (s: .stl, o: .off, w: .obj, p: .ply, c: .csv, f: .poly, n: .node), then the
// file.

#include <cmath>
#include <cstdint>
#include <string_view>

#include "base/check.h"
#include "fuzz_tools.h"
#include "mesh_files/read_ply.h"
#include "mesh_files/read_stl.h"
#include "mesh_files/read_surface_text.h"
#include "surface/check_surface.h"

namespace tessera {
namespace {

RawSurface parse(char format, const NamedText& text) {
    switch (format) {
        case 's':
            return readStl(text);
        case 'o':
            return readOff(text);
        case 'w':
            return readObj(text);
        case 'p':
            return readPly(text);
        case 'c':
            return readCsv(text);
        case 'f':
            return readPoly(text, "fuzz.node", [] { return std::string("1 3 0 0\n0 0 0 0\n"); });
        default:
            return readNodePoints(text);
    }
}

void checkSizes(const RawSurface& raw) {
    for (const std::int32_t corner : raw.corners)
        TESSERA_CHECK(corner >= 0 && std::size_t(corner) < raw.points.size(), "corners are points");
    for (const Field& field : raw.fields) {
        TESSERA_CHECK(field.components >= 1 && !field.name.empty(), "fields have names and components");
        const std::size_t items =
            field.location == FieldLocation::point ? raw.points.size() : std::size_t(raw.polygonCount());
        TESSERA_CHECK(field.values.size() == items * std::size_t(field.components),
                      "fields have a value each");
    }
}

/// Polygons as fans.
Surface surfaceOf(const RawSurface& raw) {
    Surface surface;
    surface.points = raw.points;
    for (std::int64_t p = 0; p < raw.polygonCount(); ++p) {
        const auto corners = raw.polygon(p);
        TESSERA_CHECK(corners.size() >= 3, "polygons have three corners");
        for (std::size_t i = 2; i < corners.size(); ++i)
            surface.triangles.push_back({corners[0], corners[i - 1], corners[i]});
    }
    return surface;
}

void checkFaults(Surface surface) {
    const Execution execution = fuzz::oneThread();
    const auto findings = findSurfaceFaults(surface, execution, nullptr);
    if (!findings.empty()) TESSERA_CHECK(!faultSentence(findings, surface).empty(), "faults have words");
    repairSurface(surface, execution);
    const auto left = findSurfaceFaults(surface, execution, nullptr);
    if (!left.empty() && left[0].fault == SurfaceFault::degenerate) return;  // those join parts, too
    for (const SurfaceFinding& finding : left)
        TESSERA_CHECK(finding.fault != SurfaceFault::turned && finding.fault != SurfaceFault::duplicate,
                      "a repair turns triangles and removes what is there twice");
}

void run(std::string_view input) {
    if (input.empty()) return;
    const RawSurface raw = parse(input[0], {"fuzz", input.substr(1)});
    checkSizes(raw);
    for (const Vec3d& p : raw.points)
        if (!(std::abs(p.x) <= 1e100 && std::abs(p.y) <= 1e100 && std::abs(p.z) <= 1e100)) return;  // refused
    if (raw.polygonCount() > 0) checkFaults(surfaceOf(raw));
}

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    tessera::fuzz::expectInputErrorsOnly([&] { tessera::run({reinterpret_cast<const char*>(data), size}); });
    return 0;
}
