#include "render/effects/isosurfaces.h"

#include <algorithm>

#include "render/shaders.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kMostSurfaces = 16;

}  // namespace

Effect isosurfacesEffect(std::vector<Isosurface> surfaces, const Vec3d& towardsLight) {
    if (surfaces.empty() || surfaces.size() > kMostSurfaces)
        throw InputError("a picture has 1 to 16 isosurfaces");
    std::stable_sort(surfaces.begin(), surfaces.end(),
                     [](const Isosurface& a, const Isosurface& b) { return a.value < b.value; });
    namespace text = shaders::render;
    Effect effect;
    effect.name = "isosurfaces";
    effect.texts = {text::kPoolPlace, text::kNear, text::kGradient, text::kLight, text::kIsosurfaces};
    effect.sheet = "isosurfacesSheet";
    effect.hasSheet = "isosurfacesCross";
    effect.needsAllBricks = true;
    effect.readsIndex = true;
    effect.setUniforms = [surfaces, towardsLight](const EffectScene& scene) {
        std::vector<std::array<float, 4>> shown;
        std::vector<float> codes;
        for (const Isosurface& surface : surfaces) {
            shown.push_back({float(surface.color[0]), float(surface.color[1]), float(surface.color[2]),
                             float(surface.opacity)});
            codes.push_back(float(scene.coding.encode(surface.value)));
        }
        scene.set("isosurfaces", shown);
        scene.set("isosurfaceCodes", codes);
        scene.set("isosurfaceCount", int(surfaces.size()));
        scene.setDirection("isosurfaceLight", towardsLight);
    };
    return effect;
}

}  // namespace tessera
