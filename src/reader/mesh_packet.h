#pragma once

#include <cstddef>
#include <span>

#include "mesh_files/read_mesh.h"
#include "reader/packet.h"

namespace tessera {

Packet packMesh(MeshFile file);

/// The mesh file in a packet, bit for bit. Nothing is believed: sizes are checked against the packet's, every
/// node index against the number of nodes, and coordinates are finite. Throws DamagedPacket.
MeshFile unpackMesh(std::span<const std::byte> packet, const Execution& execution);

}  // namespace tessera
