#pragma once

#include "scene/scene.h"
#include "tessera/focus.h"
#include "tessera/vec.h"
#include "view/scene_document.h"

namespace tessera {

/// A camera that a hand moves, around a place that it looks at.
struct ViewCamera {
    Vec3d eyeWorld{0}, targetWorld{0}, up{0, 0, 1};
    double openingDegrees = 35;
    double heightWorld = 0;  ///< above 0: parallel rays

    /// That of a scene's picture. @param targetWorld where a camera without one looks at.
    static ViewCamera of(const Camera& camera, const Vec3d& targetWorld);
    /// As scenes have it.
    SceneDocument::Json json() const;

    // Distances of the hand are shares of the picture's height.
    /// Around the target: to the right about `up`, then up, never beyond the poles.
    void orbit(double right, double up_);
    /// The scene follows the hand at the target.
    void pan(double right, double up_);
    /// Nearer by that factor, above 0.
    void zoom(double factor);
    /// Moves eye and target, in shares of the distance between them.
    void fly(double forward, double right, double up_);

  private:
    Vec3d forward() const;
    double heightAtTarget() const;
};

}  // namespace tessera
