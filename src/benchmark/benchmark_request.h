#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/peer_process.h"
#include "tessera/resampler.h"

namespace tessera {

/// What `tessera bench` is asked for.
struct BenchmarkRequest {
    std::string mesh;                 ///< a file; empty: a graded box
    std::int64_t gradedElements = 0;  ///< of it, above 0
    std::string folder;               ///< where the report goes; made when it isn't there
    std::string field;                ///< empty: the first scalar field of the points
    std::string algorithms;  ///< as listAlgorithms() takes them; empty: all there are, all their ways
    BindOptions bind;        ///< platform of those on a device
    std::vector<PeerCommand> peers;
    bool hasVtk = true;                    ///< VTK is a peer, where its program stands beside this one
    bool isQuick = false;                  ///< few cases, a minute in all
    std::vector<int> resolutions;          ///< points along the longest axis; empty: some that suit
    std::optional<int> rounds;             ///< not given: 9, or 6 where it is to be quick
    std::optional<double> seconds;         ///< for all rounds; not given: 300, or 24 where it is to be quick
    std::optional<double> longestSeconds;  ///< of one run: slower cases are left out; not given: 2.5, or 0.3
    std::uint64_t seed = 1;                ///< of orders and places
    std::string comparedWith;              ///< the report.json of an earlier run; empty: none
    std::string program;  ///< tessera itself, which samples in processes of its own for their memory
};

}  // namespace tessera
