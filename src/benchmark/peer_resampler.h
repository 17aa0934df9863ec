#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "benchmark/peer_process.h"
#include "tessera/resampler.h"

namespace tessera {

/// Stage of a peer's statistics: wall clock beside its own sampling, that is requests, its file of samples,
/// cutting them into boxes, the sink. stage::sample holds the sampling alone, as the peer tells it.
inline constexpr std::string_view kTransferStage = "transfer_ms";
/// Count of a peer's statistics.
inline constexpr std::string_view kPeerRequests = "peer_requests";

/// A program that samples meshes, as a resampler: docs/benchmark_peers.md. It doesn't meet the contract; its
/// bounds, 2^-8 voxels, are those by which Tessera's own methods of the least accuracy are judged. Points
/// are covered where all channels are finite.
///
/// bind() writes the mesh into a temporary folder, starts the program and waits until it has read the mesh;
/// target() is then the name that the peer gives itself. Throws IoError when it fails, InputError for
/// options other than the default.
///
/// resample() takes axis-parallel lattices alone, else throws InputError. Boxes that fill half of the box
/// around them are one request; those that don't are parted until they do. Calls wait for one another.
/// Throws IoError, with the peer's name and its last words, when it fails; later calls then fail with the
/// same words, but for an error that it answered with. Cancelled ends the peer too.
std::unique_ptr<const Resampler> makePeer(PeerCommand peer);

/// vtkResampleToImage, when tessera-vtk-peer stands in that folder, the running program's.
std::optional<PeerCommand> vtkPeer(const std::string& programFolder);

}  // namespace tessera
