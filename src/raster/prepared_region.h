#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "device/texture_slots.h"
#include "index_space/node_frame.h"
#include "raster/channel_coding.h"
#include "raster/element_shape.h"
#include "raster/slice_batch.h"
#include "tessera/execution.h"
#include "tessera/lattice.h"

namespace tessera {

/// Face distances of an element as the shaders read them; `base` is relative to the region's first point.
struct EasyGeometry {
    float normal[3][4];  ///< axis by axis, of the four faces
    float offset[4];
    float base[3];
    float slack;
};
struct alignas(32) ThinGeometry {
    double normal[3][4];
    double offset[4];
    float base[3];
    float slack;
};
static_assert(sizeof(EasyGeometry) == 80 && sizeof(ThinGeometry) == 160 && sizeof(ChannelRecord) == 32);

/// Channels that one pass over a region samples: those of a target's pixel.
inline constexpr std::size_t kChannelsAPass = kChannelsAGroup;

/// Records of one grade, in no order; element i's channels of a pass are channels[pass][i * channelCount
/// ...].
template <class Geometry>
struct RecordList {
    std::vector<Geometry> geometry;
    std::vector<std::vector<ChannelRecord>> channels;
};

/// What is sampled, and how.
struct RasterInputs {
    const TetMesh& mesh;
    const NodeFrame& frame;
    std::span<const ChannelCoding> channels;
    SampleFormat format = SampleFormat::r32f;
    SliceAxes axes;

    std::size_t passCount() const {
        return std::max<std::size_t>(1, (channels.size() + kChannelsAPass - 1) / kChannelsAPass);
    }
    std::span<const ChannelCoding> channelsOf(std::size_t pass) const {
        const std::size_t from = pass * kChannelsAPass;
        return channels.subspan(from, std::min(kChannelsAPass, channels.size() - from));
    }
    /// Channels of a record: one even where nothing but coverage is wanted.
    int recordedChannels(std::size_t pass) const {
        return int(std::max<std::size_t>(1, channelsOf(pass).size()));
    }
};

/// The elements of a region, ready for generators and shaders.
struct PreparedRegion {
    IndexBox points;
    std::vector<SliceElement> elements;  ///< ascending
    RecordList<EasyGeometry> easy;
    RecordList<ThinGeometry> thin;
    std::vector<std::int32_t> hard;  ///< element numbers
    /// Pairs of element and slice that are left out, because no point of the slice can be in the element.
    std::int64_t emptyPairs = 0;
    /// In place of the others for the published methods; elements without volume in double are left out.
    std::vector<PublishedGeometry> published;
    /// A list a pass: record by record, channel by channel.
    std::vector<std::vector<NodeCodes>> nodeCodes;
};

/// Sets all of an element but its record. False when it holds no lattice point of the region.
bool placeInRegion(const ElementShape& shape, const IndexBox& points, SliceElement& e);

/// @param elements those that may reach the region, ascending. The result doesn't depend on threads.
PreparedRegion prepareRegion(const RasterInputs& inputs, const IndexBox& points,
                             std::span<const std::int32_t> elements, const Execution& execution);

/// The same for the published methods.
PreparedRegion preparePublishedRegion(const RasterInputs& inputs, const IndexBox& points,
                                      std::span<const std::int32_t> elements, const Execution& execution);

/// Slabs of `layersASlab` layers and for each the slots of the elements that reach it, ascending: the active
/// element list of Weiler and Ertl, built by counting.
struct ActiveElements {
    int layersASlab = 0;
    std::vector<std::int64_t> first;  ///< slabs + 1 offsets into `slots`
    std::vector<std::int32_t> slots;

    std::size_t slabCount() const { return first.size() - 1; }
    std::span<const std::int32_t> of(std::size_t slab) const {
        return {slots.data() + first[slab], std::size_t(first[slab + 1] - first[slab])};
    }
};
ActiveElements listActiveElements(const PreparedRegion& region, const SliceAxes& axes, int layersASlab);

/// The slice axis with the fewest pairs of element and slice, over the whole mesh: z unless another is better
/// by an eighth, since memory runs along x.
int chooseLayerAxis(const TetMesh& mesh, const NodeFrame& frame, const Execution& execution);
/// The same by the pairs along each axis.
int layerAxisOf(const Vec3d& pairs);

}  // namespace tessera
