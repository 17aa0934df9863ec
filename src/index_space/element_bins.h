#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/large_pages.h"
#include "index_space/near_kernel.h"
#include "index_space/node_frame.h"
#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// For every region the elements near its lattice points, ascending.
struct ElementBins {
    std::vector<std::int64_t> first;  ///< regions + 1 offsets into `elements`
    UninitializedVector<std::int32_t> elements;

    std::span<const std::int32_t> of(std::size_t region) const {
        return {elements.data() + first[region], std::size_t(first[region + 1] - first[region])};
    }
};

/// Built by counting: one pass finds the pairs, one puts them in their places. Elements without a lattice
/// point in their (slightly widened) bounding box appear nowhere.
ElementBins binElements(const TetMesh& mesh, const NodeFrame& frame, std::span<const IndexBox> regions,
                        const Execution& execution, const NearTest& test = {});

}  // namespace tessera
