#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string_view>
#include <tuple>
#include <vector>

#include "gl/gl_program.h"
#include "raster/record_maker.h"
#include "raster/slice_batch.h"

namespace tessera {

/// Makes what stands for the elements of a region by compute shaders, from records that are on the device;
/// the algorithm's shader says what. All functions run on the device's OpenGL thread.
class PrimitiveMaker {
  public:
    /// Layers that are drawn together, and how many primitives each kind of elements has in them at most.
    struct Slab {
        int begin = 0, end = 0;
        std::array<std::int64_t, kKinds> counts{};
    };
    /// Slabs of so many bytes, or of one layer.
    static std::vector<Slab> slabs(const LayerCounts& layers, std::int64_t most);

    struct Made {
        GLuint buffer = 0;  ///< that the next call fills again
        std::size_t count = 0;
    };
    /// Sprites of small elements, four corners each of large ones, by ascending records.
    Made make(GlContext& context, RecordMaker& records, const DeviceMesh& mesh, const SliceAxes& axes,
              const ShaderText& algorithm, const Slab& slab, std::size_t kind);

  private:
    using Variant = std::tuple<std::string_view, std::size_t, bool>;  ///< algorithm, kind, areCounts
    /// @param algorithm null: what marks the elements that are drawn.
    const GlProgram& program(GlContext& context, const ShaderText* algorithm, std::size_t kind,
                             bool areCounts);

    std::map<Variant, GlProgram> programs_;
    GlBuffer marks_, slots_, counts_, sums_, primitives_;
};

/// Whether elements of a kind are large, and thin.
inline bool isLargeKind(std::size_t kind) {
    return kind % 2 != 0;
}
inline bool isThinKind(std::size_t kind) {
    return kind / 2 != 0;
}

}  // namespace tessera
