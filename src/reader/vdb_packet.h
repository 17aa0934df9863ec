#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "reader/packet.h"
#include "tessera/execution.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// What of a VDB file is handed over.
enum class VdbContents { all, withoutValues };

/// Throws std::bad_alloc where whoever unpacks it would need more than that.
Packet packVdb(VdbFile file, VdbContents contents, std::int64_t mostBytes);

/// The file in a packet, bit for bit; without values its store has no channels. Nothing is believed: the
/// metadata is decoded anew, and every tile lies in a brick or where an extension may, no two in one place.
/// Throws DamagedPacket, also where the file would need more memory than that.
VdbFile unpackVdb(std::span<const std::byte> packet, std::int64_t mostBytes, const Execution& execution);

}  // namespace tessera
