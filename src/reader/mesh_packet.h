#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>

#include "mesh_files/read_mesh.h"

namespace tessera {

/// Bytes that aren't a whole, sound packet: where and why.
class DamagedPacket : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Takes the next bytes of a packet.
using PacketSink = std::function<void(const void* bytes, std::size_t count)>;

/// Size of a mesh file's packet: the form in which one process hands it to another of the same build.
std::int64_t packetBytes(const MeshFile& file);

/// Gives the packet to `sink` piece by piece, and the mesh's memory back on the way.
void writePacket(MeshFile file, const PacketSink& sink);

/// The mesh file in a packet, bit for bit. Nothing is believed: sizes are checked against the packet's, every
/// node index against the number of nodes, and coordinates are finite. Throws DamagedPacket.
/// @param packet starts at a multiple of 8 bytes.
MeshFile readPacket(std::span<const std::byte> packet, const Execution& execution);

}  // namespace tessera
