#include "raster/slice_batch.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tessera {

namespace {

/// Corners that move further than this make way for a rectangle.
constexpr double kLongestMiter = 0x1p-3;

}  // namespace

void emitRect(const PixelRect& rect, int layer, const SliceElement& element, PrimitiveList& list) {
    if (element.isSmall) {
        const int edge = std::max(rect.s1 - rect.s0, rect.t1 - rect.t0) + 1;
        list.sprites.push_back({element.record, std::uint16_t(rect.s0), std::uint16_t(rect.t0),
                                std::uint16_t(layer), std::uint16_t(edge)});
        return;
    }
    const auto s0 = float(rect.s0), t0 = float(rect.t0), s1 = float(rect.s1 + 1), t1 = float(rect.t1 + 1);
    const auto l = std::uint32_t(layer);
    for (const auto& [s, t] : {std::pair(s0, t0), std::pair(s1, t0), std::pair(s1, t1), std::pair(s0, t1)})
        list.corners.push_back({s, t, element.record, l});
}

bool emitGrown(std::span<const std::array<double, 2>> corners, double growth, int layer, std::uint32_t record,
               PrimitiveList& list) {
    const std::size_t n = corners.size();
    double directions[4][2];
    for (std::size_t k = 0; k < n; ++k) {
        const auto& a = corners[k];
        const auto& b = corners[(k + 1) % n];
        const double ds = b[0] - a[0], dt = b[1] - a[1];
        const double length = std::sqrt(ds * ds + dt * dt);
        if (!(length > 0x1p-10)) return false;
        const double inverse = 1 / length;
        directions[k][0] = ds * inverse;
        directions[k][1] = dt * inverse;
    }
    // Corner k between the edges that end and begin there moves by growth (d_in - d_out) / sin(turn).
    double turnSign = 0, grown[4][2];
    for (std::size_t k = 0; k < n; ++k) {
        const double* in = directions[(k + n - 1) % n];
        const double* out = directions[k];
        const double turn = in[0] * out[1] - in[1] * out[0];
        if (turnSign == 0) turnSign = turn < 0 ? -1 : 1;
        const double sine = turn * turnSign;
        const double cosine = in[0] * out[0] + in[1] * out[1];
        if (!(sine > 0x1p-16)) return false;
        const double along = growth / sine;
        if (along * along * (2 - 2 * cosine) > kLongestMiter * kLongestMiter) return false;
        for (int a = 0; a < 2; ++a) grown[k][a] = corners[k][std::size_t(a)] + along * (in[a] - out[a]);
    }
    for (std::size_t k = 0; k < 4; ++k) {
        const auto& [s, t] = grown[std::min(k, n - 1)];
        list.corners.push_back({float(s), float(t), record, std::uint32_t(layer)});
    }
    return true;
}

}  // namespace tessera
