#pragma once

#include <string>
#include <vector>

#include "scene/scene.h"

namespace tessera {

/// Where a camera is at a time.
struct CameraKey {
    double time = 0;
    Vec3d eyeWorld{0}, targetWorld{0}, up{0, 0, 1};
    double openingDegrees = 35;
    double heightWorld = 0;  ///< above 0: parallel rays, and a picture so high
};

/// A camera that moves through key frames, smoothly: between two of them every coordinate is a cubic
/// polynomial of the time, whose slope at a key is that between the keys beside it (Catmull and Rom, for keys
/// at any times), and at the first and the last one that to the next.
class CameraPath {
  public:
    /// @param keys at least one, ascending by time; all with parallel rays, or none.
    explicit CameraPath(std::vector<CameraKey> keys);

    double beginTime() const { return keys_.front().time; }
    double endTime() const { return keys_.back().time; }
    /// At the first or last key beyond them.
    SceneCamera at(double time) const;

  private:
    std::vector<CameraKey> keys_;
};

/// Reads {"version": 1, "keys": [{"time": 0, "eye": [9, 0, 3], "target": [0, 0, 0], "up": [0, 0, 1],
/// "opening": 30}]}. Without times keys are one apart. Throws InputError with the file and the place in it,
/// IoError.
CameraPath readCameraPath(const std::string& path);

/// Turns a scene's camera around the upward line through what it looks at, by a share of a full turn. One
/// without an eye is at first where the scene has it, and so far away that all is in the picture all the way
/// round.
/// @param boundsWorld, legendPixels as cameraOf has them.
SceneCamera orbited(const Scene& scene, const Box3d& boundsWorld, int legendPixels, double share);

}  // namespace tessera
