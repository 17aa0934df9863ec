#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/rgba_image.h"
#include "reference/mesh_rays.h"
#include "refine/brick_result.h"
#include "refine/refine_options.h"
#include "scene/scene.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

class MeshSource;
class SliceRenderer;
class NearestOnDemand;
struct RenderOptions;

/// How two pictures differ: the root of the mean square of red, green and blue, in steps of 1/255.
struct PictureDifference {
    double all = 0;     ///< over the pixels that see the mesh, what is drawn beside them counted with them
    double inside = 0;  ///< over those more than four pixels from where the number of the mesh's parts along
                        ///< the ray changes, as at silhouettes
};

/// What became of some bricks.
struct PictureErrors {
    PictureDifference drawn;    ///< as `tessera render` draws their file
    PictureDifference clipped;  ///< the same with a clip box at the mesh's bounds, beyond which voxels reach
    /// By fine steps of rays that are cut with the elements, as in the exact picture, so that neither the
    /// outline of voxels nor slices count.
    PictureDifference values;
    double extendMs = 0, drawMs = 0;
};

/// The exact picture of a field, rays cut with the elements without any sampling (castMesh), and pictures of
/// bricks against it: written with --extend 1 as a .vdb file, and drawn from there as `tessera render` does
/// without a scene, with one ray a pixel and no legend. Camera, transfer function and layer are those that it
/// chooses for the mesh.
class PictureReference {
  public:
    using Keep = std::function<void(const std::string& name, const RgbaImage& image)>;
    /// @param field as a scene names it. @param keep gets every picture, the exact one too; may be null.
    /// Throws InputError and GlError.
    PictureReference(const TetMesh& mesh, const std::string& field, int sizePixels,
                     const Execution& execution, Keep keep = {});
    ~PictureReference();

    /// With that field alone.
    const TetMesh& mesh() const;
    const std::string& title() const;
    const Scene& scene() const { return scene_; }
    double exactMs() const { return exactMs_; }
    std::int64_t pixelsOfMesh() const { return meshCount_; }
    std::int64_t pixelsInside() const { return insideCount_; }

    /// As drawn alone. @param result bricks of mesh(), by `resampler` with these options; their store gets
    /// its extension.
    PictureErrors measureDrawn(const Resampler& resampler, const RefineOptions& refine, BrickResult& result,
                               const std::string& name, const Execution& execution) const {
        return measure(resampler, refine, result, name, execution, false);
    }
    /// All of it.
    PictureErrors measureAll(const Resampler& resampler, const RefineOptions& refine, BrickResult& result,
                             const std::string& name, const Execution& execution) const {
        return measure(resampler, refine, result, name, execution, true);
    }

  private:
    PictureErrors measure(const Resampler& resampler, const RefineOptions& refine, BrickResult& result,
                          const std::string& name, const Execution& execution, bool isAll) const;
    PictureDifference differenceTo(const RgbaImage& image) const;

    Scene scene_;
    std::unique_ptr<MeshSource> source_;  // for its mesh and what is chosen by it; nothing is sampled
    std::unique_ptr<RenderOptions> picture_;
    std::unique_ptr<NearestOnDemand> nearest_;
    std::unique_ptr<MeshRays> rays_;
    std::unique_ptr<SliceRenderer> renderer_;
    std::vector<bool> inside_;
    std::int64_t meshCount_ = 0, insideCount_ = 0;
    RgbaImage exact_;
    double exactMs_ = 0;
    Keep keep_;
};

}  // namespace tessera
