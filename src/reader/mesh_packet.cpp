#include "reader/mesh_packet.h"

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>

#include "base/parallel.h"
#include "base/text.h"

namespace tessera {

namespace {

constexpr std::int64_t kChunk = 1 << 16;
constexpr std::int64_t kMostElements = std::int64_t(1) << 30;

/// Calls visit(member) for every number of the statistics, always in one order.
template <class Statistics, class Visit>
void visitNumbers(Statistics& s, const Visit& visit) {
    static_assert(sizeof(ImportStatistics) ==
                      sizeof(std::string) + (18 + kCellKinds) * 8 + 2 * sizeof(std::vector<std::string>),
                  "a new member of ImportStatistics needs its line below");
    for (auto& count : s.cellsOfKind) visit(count);
    visit(s.cells), visit(s.skippedCells), visit(s.blankedCells), visit(s.higherOrderCells);
    visit(s.blocks), visit(s.addedNodes), visit(s.nodes), visit(s.elements);
    visit(s.flat), visit(s.inverted), visit(s.duplicate), visit(s.coincidentNodes);
    visit(s.boundaryFaces), visit(s.nonConformingFaces);
    visit(s.smallestEdgeWorld), visit(s.largestEdgeWorld);
    visit(s.smallestVolumeWorld), visit(s.largestVolumeWorld);
}

std::string headOf(const MeshFile& file) {
    HeadWriter head;
    head.put(std::int64_t(file.mesh.nodeCount()));
    head.put(std::int64_t(file.mesh.elementCount()));
    head.put(std::int64_t(file.mesh.fields.size()));
    for (const Field& field : file.mesh.fields) {
        head.put(field.name);
        head.put(std::int64_t(field.location == FieldLocation::point ? 0 : 1));
        head.put(std::int64_t(field.components));
    }
    head.put(file.readPeakBytes);
    head.put(file.statistics.format);
    visitNumbers(file.statistics, [&](auto number) { head.put(number); });
    head.put(file.statistics.warnings);
    head.put(file.statistics.notes);
    return head.take();
}

/// Everything but the arrays, which stay empty.
MeshFile readHead(const ReceivedPacket& packet, std::int64_t& nodes, std::int64_t& elements) {
    HeadReader head = packet.head();
    MeshFile file;
    nodes = head.getCount(std::numeric_limits<std::int32_t>::max(), "nodes");
    elements = head.getCount(kMostElements, "elements");
    const std::int64_t fields = head.getCount(packet.headBytes(), "fields");
    for (std::int64_t f = 0; f < fields; ++f) {
        Field& field = file.mesh.fields.emplace_back();
        field.name = head.getText();
        if (field.name.empty() || field.name != plainName(field.name))
            throw DamagedPacket("a field has no proper name");
        field.location =
            head.getCount(1, "as a field's place") == 0 ? FieldLocation::point : FieldLocation::cell;
        field.components = int(head.getCount(9, "components in a field"));
        if (field.components == 0) throw DamagedPacket("a field has no components");
    }
    file.readPeakBytes = head.getCount(std::int64_t(1) << 60, "bytes of memory");
    file.statistics.format = messageLine(head.getText());
    visitNumbers(file.statistics, [&](auto& number) {
        number = head.get<std::remove_reference_t<decltype(number)>>();
        if (!(number >= 0)) throw DamagedPacket("a number is below 0");
    });
    for (auto* sentences : {&file.statistics.warnings, &file.statistics.notes}) {
        *sentences = head.getTexts();
        for (std::string& sentence : *sentences) sentence = messageLine(sentence);
    }
    head.expectEnd();
    return file;
}

template <class Item>
void writeArray(std::vector<Item>& items, const PacketSink& sink) {
    static_assert(std::is_trivially_copyable_v<Item> && sizeof(Item) % 8 == 0);
    if (!items.empty()) sink(items.data(), items.size() * sizeof(Item));
    items = {};
}

template <class IsSound>
void checkItems(std::int64_t count, const Execution& execution, const char* complaint,
                const IsSound& isSound) {
    parallelForChunks(execution, count, kChunk, [&](std::int64_t begin, std::int64_t end) {
        bool sound = true;
        for (std::int64_t i = begin; i < end; ++i) sound &= isSound(std::size_t(i));
        if (!sound) throw DamagedPacket(complaint);
    });
}

void checkArrays(const TetMesh& mesh, const Execution& execution) {
    const auto nodes = std::uint32_t(mesh.points.size());
    checkItems(mesh.elementCount(), execution, "a node index is out of range", [&](std::size_t e) {
        const auto& t = mesh.tets[e];
        return (std::uint32_t(t[0]) < nodes) & (std::uint32_t(t[1]) < nodes) & (std::uint32_t(t[2]) < nodes) &
               (std::uint32_t(t[3]) < nodes);
    });
    checkItems(mesh.nodeCount(), execution, "a coordinate isn't finite", [&](std::size_t n) {
        const Vec3d& p = mesh.points[n];
        return std::isfinite(p.x) & std::isfinite(p.y) & std::isfinite(p.z);
    });
}

}  // namespace

Packet packMesh(MeshFile file) {
    try {
        checkMesh(file.mesh);
    } catch (const InputError& error) {
        throw InternalError(error.what());  // a reader's fault, not the file's
    }
    Packet packet;
    packet.head = headOf(file);
    std::size_t bytes =
        file.mesh.points.size() * sizeof(Vec3d) + file.mesh.tets.size() * sizeof(file.mesh.tets[0]);
    for (const Field& field : file.mesh.fields) bytes += field.values.size() * sizeof(double);
    packet.arrayBytes = std::int64_t(bytes);
    packet.writeArrays = [mesh = std::make_shared<TetMesh>(std::move(file.mesh))](const PacketSink& sink) {
        writeArray(mesh->points, sink);
        writeArray(mesh->tets, sink);
        for (Field& field : mesh->fields) writeArray(field.values, sink);
    };
    return packet;
}

MeshFile unpackMesh(std::span<const std::byte> bytes, const Execution& execution) {
    ReceivedPacket packet(bytes);
    std::int64_t nodes = 0, elements = 0;
    MeshFile file = readHead(packet, nodes, elements);
    file.mesh.points = packet.copy<Vec3d>(nodes, "nodes");
    file.mesh.tets = packet.copy<std::array<std::int32_t, 4>>(elements, "elements");
    for (Field& field : file.mesh.fields)
        field.values = packet.copy<double>(
            (field.location == FieldLocation::point ? nodes : elements) * field.components, "fields");
    packet.expectEnd();
    checkArrays(file.mesh, execution);
    return file;
}

}  // namespace tessera
