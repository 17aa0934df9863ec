#include "raster/raster_budget.h"

#include <algorithm>

#include "raster/point_scan.h"
#include "raster/prepared_region.h"

namespace tessera {

namespace {

constexpr std::int64_t kMiB = 1 << 20;
// Measured with Mesa's llvmpipe and rounded up: the driver, its compiler, compiled shaders.
constexpr std::int64_t kDriverBytes = 112 * kMiB;
constexpr std::int64_t kLeastBytes = 16 * kMiB, kLeastBytesPerChannel = 4 * kMiB;
constexpr std::int64_t kMostBytes = 1024 * kMiB;
constexpr double kSpread = 1.25;

constexpr std::int64_t kPassChannels = std::int64_t(kChannelsAPass);
// Targets have a margin for points that hang over, two regions are under way, and vectors and buffers grow
// by more than is needed at once.
constexpr double kTargetRoom = 1.4, kRegionsAtOnce = 2, kRecordRoom = 1.5, kBufferRoom = 1.25;

}  // namespace

WorkMemory rasterWorkMemory(int channels) {
    const std::int64_t least = kLeastBytes + kLeastBytesPerChannel * channels;
    return {kDriverBytes, least, std::max(least, kMostBytes), kSpread};
}

RasterBudget shareOut(std::int64_t workBytes, int channels) {
    const WorkMemory memory = rasterWorkMemory(channels);
    const auto bytes = double(workBytes > 0 ? std::max(workBytes, memory.least) : memory.most);
    const std::int64_t recorded = std::max(1, channels);
    const std::int64_t passes = (recorded + kPassChannels - 1) / kPassChannels;
    const double codeBytes = recorded > 1 ? 16 : 4, depthBytes = 16;  // depths, or what a scan notes
    const double pointBytes =
        kTargetRoom * (codeBytes + depthBytes) + kRegionsAtOnce * double(passes) * codeBytes;
    const double records = sizeof(SliceElement) + 2 * sizeof(ScanBox) + sizeof(EasyGeometry) +
                           sizeof(ChannelRecord) * double(recorded);
    const double onDevice = sizeof(EasyGeometry) + sizeof(ScanBox) +
                            sizeof(ChannelRecord) * double(std::min(recorded, kPassChannels));
    const double elementBytes = kRegionsAtOnce * (kRecordRoom * records + kBufferRoom * onDevice);
    // The last eighth is for blocks that are put together and for what an emulated device keeps of
    // primitives.
    return {std::int64_t(bytes / 2 / pointBytes), std::int64_t(bytes / 4 / elementBytes),
            std::int64_t(bytes / 4), std::int64_t(bytes / 8)};
}

std::int64_t primitiveBytes(const SlabInput& input) {
    constexpr std::int64_t kSpriteBytes = sizeof(Sprite);
    constexpr std::int64_t kPolygonBytes = 4 * sizeof(PolygonVertex) + 6 * sizeof(std::uint32_t);
    const int axis = input.axes.l;
    std::int64_t bytes = 0;
    for (const std::int32_t slot : input.active) {
        const SliceElement& e = input.elements[std::size_t(slot)];
        const int layers =
            std::min(input.layerEnd, e.high[axis] + 1) - std::max(input.layerBegin, int(e.low[axis]));
        bytes += std::max(0, layers) * (e.isSmall ? kSpriteBytes : kPolygonBytes);
    }
    return bytes + bytes / 2;  // vectors grow by doubling
}

std::shared_ptr<const void> QueueRoom::take(std::int64_t bytes) {
    std::unique_lock lock(mutex_);
    freed_.wait(lock, [&] { return taken_ == 0 || taken_ + bytes <= bytes_; });
    taken_ += bytes;
    lock.unlock();
    return {this, [bytes](QueueRoom* room) {
                const std::lock_guard guard(room->mutex_);
                room->taken_ -= bytes;
                room->freed_.notify_all();
            }};
}

}  // namespace tessera
