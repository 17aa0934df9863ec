#pragma once

#include "render/effect.h"

namespace tessera {

/// Pre-integrated classification (K. Engel, M. Kraus, T. Ertl, 2001): a slab has all that the transfer
/// function has between the values at its ends, so thin shells show no slices. There is no table: the
/// integral is taken from stop to stop, so that no stop is too thin.
Effect preintegrationEffect();

}  // namespace tessera
