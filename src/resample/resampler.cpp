#include "tessera/resampler.h"

#include "tessera/lattice.h"

#include "resample/device_slots.h"

namespace tessera {

std::string_view nameOf(Primitives primitives) {
    return primitives == Primitives::device ? "device" : "processor";
}

std::string_view nameOf(SampleFormat format) {
    switch (format) {
        case SampleFormat::r32f:
            return "r32f";
        case SampleFormat::r16f:
            return "r16f";
        case SampleFormat::r16:
            return "r16";
        case SampleFormat::r8:
            return "r8";
    }
    return "unknown";
}

ResampleStatistics BoundResampler::resampleToDevice(const Lattice& lattice, std::span<const IndexBox> boxes,
                                                    DeviceSlots& slots, const Execution& execution) {
    return resample(
        lattice, boxes, [&](std::size_t box, const Block& block) { slots.upload(box, block); }, execution);
}

WorkMemory Resampler::workMemory(int channels) const {
    // Blocks of 64^3 points in flight, one or two.
    const std::int64_t bytes = (std::int64_t(16) << 20) + (std::int64_t(2) << 20) * channels;
    return {0, bytes, bytes};
}

Block resampleBlock(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                    const Lattice& lattice, const IndexBox& box, const Execution& execution) {
    Block result;
    const auto bound = resampler.bind(mesh, fields);
    bound->resample(
        lattice, std::span(&box, 1), [&](std::size_t, const Block& block) { result = block; }, execution);
    return result;
}

}  // namespace tessera
