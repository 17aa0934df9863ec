#include "job/source_effects.h"

#include <algorithm>
#include <cmath>

#include "job/import_mesh.h"
#include "tessera/error.h"

namespace tessera {

namespace {

Effect outlineOf(const SceneOutline& outline, const PictureSource& source, Job& job) {
    if (!outline.mesh.empty()) return outlineEffect(openMesh(outline.mesh, {}, job).mesh, outline.shown);
    if (const TetMesh* mesh = source.sourceMesh()) return outlineEffect(*mesh, outline.shown);
    throw InputError("effects.outline.mesh is missing: a .vdb file doesn't have the mesh it was made of");
}

void checkErrors(const PictureSource& source) {
    const std::vector<float> errors = source.brickErrors();
    if (errors.empty())
        throw InputError(
            "effects.errors: errors of single bricks aren't known; tessera resample --brick-statistics "
            "stores "
            "them in a .vdb file");
    if (std::ranges::none_of(errors, [](float error) { return std::isfinite(error); }))
        throw InputError("effects.errors: the errors of the file's bricks weren't measured");
}

}  // namespace

Scene withEffectsOf(Scene scene, const PictureSource& source, Job& job) {
    for (Effect& effect : scene.effects)
        if (effect.name == kOutline)
            effect = outlineOf(scene.outline, source, job);
        else if (effect.needsBrickNumbers)
            checkErrors(source);
    return scene;
}

}  // namespace tessera
