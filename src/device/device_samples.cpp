#include "device/device_samples.h"

#include <utility>

namespace tessera {

std::shared_ptr<DeviceSamples> DeviceSamples::make(GlThread& thread, std::span<const IndexBox> boxes,
                                                   std::vector<ValueCoding> codings, SampleFormat format) {
    std::shared_ptr<DeviceSamples> samples(
        new DeviceSamples(thread, std::move(codings), format),
        [&thread](DeviceSamples* s) { thread.run([s](GlContext&) { delete s; }); });
    thread.run([&](GlContext& context) {
        for (const IndexBox& box : boxes)
            for (std::size_t group = 0; group < samples->groupCount(); ++group) {
                const Vec3i size = glm::max(box.size(), Vec3i(1));
                Textures& made = samples->textures_.emplace_back();
                made.codes =
                    GlTexture(context, GL_TEXTURE_3D, textureFormat(format, samples->channelsOf(group)),
                              size.x, size.y, size.z);
                if (needsCoverageTexture(format))
                    made.coverage = GlTexture(context, GL_TEXTURE_3D, GL_R8, size.x, size.y, size.z);
            }
    });
    return samples;
}

SlotPlace DeviceSamples::place(std::size_t boxIndex, std::size_t group) const {
    const Textures& textures = textures_[boxIndex * groupCount() + group];
    return {&textures.codes, &textures.coverage, Vec3i(0)};
}

}  // namespace tessera
