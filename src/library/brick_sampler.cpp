#include "tessera/brick_sampler.h"

#include <algorithm>
#include <cmath>

#include "library/field_choice.h"
#include "library/program.h"
#include "mesh/element_index.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {

namespace {

constexpr int kLongestEdge = 1024;
constexpr std::int64_t kUsualPoints = 32 * 32 * 32;
/// Lattice points have indices within it.
constexpr double kFarthestIndex = 0x1p29;

}  // namespace

struct BrickSampler::Parts {
    std::unique_ptr<BoundResampler> bound;
    Vec3d originWorld{0};
};

BrickSampler::BrickSampler(const TetMesh& mesh, const SamplerOptions& options)
    : parts_(std::make_unique<Parts>()) {
    checkMesh(mesh);
    const ChosenFields chosen = chooseFields(mesh, options.fields);
    BindOptions bind;
    bind.route = Route::index;
    bind.index = std::make_shared<const SharedElementIndex>(mesh);
    tryDriversFor(options.algorithm);
    // Of a brick, with an element a point or as many as there are.
    ResamplerChoice choice =
        chooseResampler(options.algorithm, bind, {std::min(mesh.elementCount(), kUsualPoints), kUsualPoints});
    parts_->bound = runChosen(
        choice, [&](const Resampler& resampler) { return resampler.bind(mesh, chosen.fields, bind); });
    const Box3d bounds = mesh.boundsWorld();
    if (bounds.empty()) throw InputError("the mesh has no elements");
    parts_->originWorld = bounds.min;
}

BrickSampler::~BrickSampler() = default;

Block BrickSampler::around(const Vec3d& centreWorld, double spacingWorld, int edge,
                           const Execution& execution) const {
    if (!(spacingWorld > 0) || !std::isfinite(spacingWorld))
        throw InputError("the spacing of a brick must be positive, not " + std::to_string(spacingWorld));
    if (edge < 1 || edge > kLongestEdge)
        throw InputError("a brick has 1 to " + std::to_string(kLongestEdge) + " points along an edge, not " +
                         std::to_string(edge));
    const Vec3d centre = glm::round((centreWorld - parts_->originWorld) / spacingWorld);
    for (int axis = 0; axis < 3; ++axis)
        if (!(std::abs(centre[axis]) < kFarthestIndex))
            throw InputError("the place is more than 2^29 lattice points away from the mesh");
    const Vec3i first = Vec3i(centre) - edge / 2;
    return sample(Lattice::axisParallel(parts_->originWorld, spacingWorld), {first, first + edge}, execution);
}

Block BrickSampler::sample(const Lattice& lattice, const IndexBox& box, const Execution& execution) const {
    Block result;
    parts_->bound->resample(
        lattice, std::span(&box, 1), [&](std::size_t, const Block& block) { result = block; }, execution);
    return result;
}

}  // namespace tessera
