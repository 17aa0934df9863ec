#pragma once

#include "tessera/vec.h"

namespace tessera {

/// Floor division by a positive divisor.
inline int floorDiv(int a, int b) {
    return a >= 0 ? a / b : -((-a + b - 1) / b);
}
inline Vec3i floorDiv(const Vec3i& a, int b) {
    return {floorDiv(a.x, b), floorDiv(a.y, b), floorDiv(a.z, b)};
}

}  // namespace tessera
