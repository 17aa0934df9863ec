#include "tessera/lattice.h"

namespace tessera {

bool Lattice::isAxisParallel() const {
    return uWorld.y == 0 && uWorld.z == 0 && vWorld.x == 0 && vWorld.z == 0 && wWorld.x == 0 &&
           wWorld.y == 0 && uWorld.x > 0 && vWorld.y > 0 && wWorld.z > 0;
}

}  // namespace tessera
