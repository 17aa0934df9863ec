#pragma once

#include <cstdint>

#include "tessera/vec.h"

namespace tessera {

/// Pseudo-random numbers that are the same on every platform and library.
/// Based on: S. Vigna, the splitmix64 generator (public domain), after G. Steele, D. Lea and C. Flood, Fast
/// Splittable Pseudorandom Number Generators, OOPSLA 2014.
class Random {
  public:
    explicit Random(std::uint64_t seed) : state_(seed) {}

    std::uint64_t next() {
        std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        return z ^ (z >> 31);
    }
    /// Uniform in [0, 1).
    double unit() { return double(next() >> 11) * 0x1p-53; }
    /// Uniform in [-1, 1).
    double centred() { return 2 * unit() - 1; }
    Vec3d place() {
        const double x = unit(), y = unit(), z = unit();
        return {x, y, z};
    }
    Vec3d offset() { return 2.0 * place() - 1.0; }
    /// Uniform in [0, count).
    int below(int count) { return int(next() % std::uint64_t(count)); }

  private:
    std::uint64_t state_;
};

}  // namespace tessera
