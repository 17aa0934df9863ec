#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gl/gl_thread.h"
#include "job/picture_source.h"
#include "render/live_bricks.h"
#include "scene/scene.h"
#include "tessera/mesh.h"

namespace tessera {

/// One field of a mesh, or one component of it, of a vector without a component the length: as bricks that
/// follow a scene's focus. The length is that of the vectors at the nodes, interpolated.
class MeshSource : public PictureSource {
  public:
    /// Finds the field, and what its values are; samples nothing. @param mesh is copied, but for the fields
    /// that aren't shown. @param scene field, component and bricks. @param threads of its own that sample
    /// between calls of update(). Throws InputError for a field that isn't there, and a mesh without a finite
    /// value.
    MeshSource(const TetMesh& mesh, const Scene& scene, int threads, GlThread& thread,
               const Execution& execution);

    const TetMesh& mesh() const { return mesh_; }
    LiveBricks& live() { return *live_; }
    const LiveBricks& live() const { return *live_; }
    /// False where nothing changes by that (BrickScheduler::setFocus).
    bool setFocus(const Scene& scene);

    const std::string& title() const override { return title_; }
    const Box3d& boundsWorld() const override { return bounds_; }
    const ValueRange& range() const override { return range_; }
    const TetMesh* sourceMesh() const override { return &mesh_; }
    const std::vector<PictureField>& fields() const override { return fieldsThere_; }
    const BrickPool& pool() const override { return live_->pool(); }
    const BrickFrame& frame() const override { return live_->frame(); }
    std::span<const PlacedBrick> bricks() const override { return live_->bricks(); }
    std::optional<Samples> samplesAt(const Vec3d& placeWorld) const override;
    void moveTo(GlThread& thread) override { live_->moveTo(thread); }

  private:
    void fill(ValueHistogram& histogram) const override;

    int threads_;
    TetMesh mesh_;  // with the one field that is shown
    std::vector<PictureField> fieldsThere_;
    std::string title_;
    Box3d bounds_;
    ValueRange range_;
    std::unique_ptr<LiveBricks> live_;
};

/// The same of a mesh that was read from a file: what is wrong is told with its name.
std::unique_ptr<MeshSource> makeMeshSource(const std::string& path, const TetMesh& mesh, const Scene& scene,
                                           int threads, GlThread& thread, const Execution& execution);

}  // namespace tessera
