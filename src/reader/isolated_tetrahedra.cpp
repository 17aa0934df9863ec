#include "reader/isolated_tetrahedra.h"

#include <span>

#include "reader/packet.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kMostPlaces = 1 << 20;

void put(HeadWriter& body, const Vec3d& place) {
    body.put(place.x), body.put(place.y), body.put(place.z);
}

Vec3d getPlace(HeadReader& body) {
    const auto x = body.get<double>(), y = body.get<double>(), z = body.get<double>();
    return {x, y, z};
}

}  // namespace

std::string packOptions(const TetrahedralizeOptions& o) {
    HeadWriter body;
    for (const double number : {o.size.everywhere, o.size.atSurface, o.size.edgesPerCircle, o.size.growth,
                                o.size.smallest, o.quality, o.minDihedralDegrees, o.hullLimitWorld})
        body.put(number);
    body.put(o.size.field);
    body.put(std::int64_t(o.splitsBoundary));
    body.put(std::int64_t(o.repairs));
    body.put(std::int64_t(o.holesWorld.size()));
    for (const Vec3d& place : o.holesWorld) put(body, place);
    body.put(std::int64_t(o.regions.size()));
    for (const RegionSeed& seed : o.regions) {
        put(body, seed.placeWorld);
        body.put(seed.sizeWorld);
    }
    return body.take();
}

TetrahedralizeOptions unpackOptions(const std::string& text) {
    TetrahedralizeOptions o;
    try {
        HeadReader body(std::as_bytes(std::span(text)));
        for (double* number : {&o.size.everywhere, &o.size.atSurface, &o.size.edgesPerCircle, &o.size.growth,
                               &o.size.smallest, &o.quality, &o.minDihedralDegrees, &o.hullLimitWorld})
            *number = body.get<double>();
        o.size.field = body.getText();
        o.splitsBoundary = body.getCount(1, "choices") != 0;
        o.repairs = body.getCount(1, "choices") != 0;
        for (std::int64_t n = body.getCount(kMostPlaces, "holes"); n > 0; --n)
            o.holesWorld.push_back(getPlace(body));
        for (std::int64_t n = body.getCount(kMostPlaces, "regions"); n > 0; --n) {
            const Vec3d place = getPlace(body);
            o.regions.push_back({place, body.get<double>()});
        }
        body.expectEnd();
    } catch (const DamagedPacket& damage) {
        throw InputError(std::string("the options of tetrahedra make no sense: ") + damage.what());
    }
    return o;
}

std::optional<IsolatedReader> tetrahedralizerBeside(const std::string& executable) {
    const std::string program = programBeside(executable, kTetrahedralizer);
    if (program.empty()) return std::nullopt;
    return IsolatedReader{program, {kMakeTetrahedraCommand}};
}

const IsolatedReader& requireTetrahedralizer(const std::optional<IsolatedReader>& found,
                                             const std::string& path) {
    if (found) return *found;
    throw InputError(path + ": a surface or points, no cells; " + kTetrahedralizer +
                     ", which makes tetrahedra of them, isn't installed beside this program");
}

MeshFile tetrahedralizeIsolated(const IsolatedReader& program, const std::string& path,
                                const ReadOptions& read, const TetrahedralizeOptions& options,
                                const IsolationLimits& limits, const Execution& execution) {
    if (!read.otherParts.empty())
        throw InputError(path +
                         ": a surface or points, and one of several parts of a mesh; tetrahedra are made of "
                         "a single file");
    ReaderRequest request;
    request.path = path;
    request.options = read;
    request.task = kTetrahedralizeTask;
    request.body = packOptions(options);
    return askForMesh(program, std::move(request), limits, execution);
}

}  // namespace tessera
