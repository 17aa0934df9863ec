#pragma once

#include <memory>
#include <string>

namespace tessera::bench {

/// vtkResampleToImage on one mesh. Apart from the rest because VTK's thread header is no C++20.
class VtkResample {
  public:
    /// Reads a .vtu file and sets VTK's number of threads. Throws std::runtime_error.
    VtkResample(const std::string& path, int threads);
    ~VtkResample();
    /// Samples a points^3 lattice over the mesh's bounds; returns milliseconds of the filter.
    double run(int points) const;
    /// "TBB", "Sequential", ...
    std::string backend() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

/// Reads a .vtu file by VTK's reader, which uses one thread; returns milliseconds. Throws std::runtime_error.
double readByVtk(const std::string& path);

}  // namespace tessera::bench
