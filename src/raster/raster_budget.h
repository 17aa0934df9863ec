#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>

#include "raster/slice_batch.h"
#include "tessera/resampler.h"

namespace tessera {

/// Of an OpenGL resampler. The device counts as emulated, whose memory is this process's own, so that a plan
/// is the same on every machine.
WorkMemory rasterWorkMemory(int channels);

/// How the memory that sampling may take is shared out.
struct RasterBudget {
    std::int64_t regionPoints = 0;    ///< of a region: its target, and images of two regions
    std::int64_t regionElements = 0;  ///< of a region: records of two regions, here and on the device
    std::int64_t recordBytes = 0;     ///< of records that the device makes, of one region
    std::int64_t queueBytes = 0;      ///< primitives that wait for the device
};

/// @param workBytes 0: as much as speeds anything up.
RasterBudget shareOut(std::int64_t workBytes, int channels);

/// About what the primitives of these elements take.
std::int64_t primitiveBytes(const SlabInput& input);

/// A bound on bytes that wait for something.
class QueueRoom {
  public:
    explicit QueueRoom(std::int64_t bytes) : bytes_(bytes) {}

    /// Waits until there is room, or nothing else waits. The room is free again with the last copy of what
    /// comes back, on any thread; this must outlive it.
    std::shared_ptr<const void> take(std::int64_t bytes);

  private:
    std::int64_t bytes_;
    std::int64_t taken_ = 0;
    std::mutex mutex_;
    std::condition_variable freed_;
};

}  // namespace tessera
