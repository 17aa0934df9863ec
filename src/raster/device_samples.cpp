#include "raster/device_samples.h"

namespace tessera {

std::shared_ptr<DeviceSamples> makeDeviceSamples(GlThread& thread) {
    return {new DeviceSamples,
            [&thread](DeviceSamples* samples) { thread.run([samples](GlContext&) { delete samples; }); }};
}

}  // namespace tessera
