#include "job/source_effects.h"

#include "job/import_mesh.h"
#include "tessera/error.h"

namespace tessera {

namespace {

Effect outlineOf(const SceneOutline& outline, const PictureSource& source, Job& job) {
    if (!outline.mesh.empty()) return outlineEffect(openMesh(outline.mesh, {}, job).mesh, outline.shown);
    if (const TetMesh* mesh = source.sourceMesh()) return outlineEffect(*mesh, outline.shown);
    throw InputError("effects.outline.mesh is missing: a .vdb file doesn't have the mesh it was made of");
}

}  // namespace

Scene withEffectsOf(Scene scene, const PictureSource& source, Job& job) {
    for (Effect& effect : scene.effects)
        if (effect.name == kOutline) effect = outlineOf(scene.outline, source, job);
    return scene;
}

}  // namespace tessera
