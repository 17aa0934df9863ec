#pragma once

#include "job/job.h"
#include "job/picture_source.h"
#include "scene/scene.h"

namespace tessera {

/// A scene whose effects have what they take of the source, or of files that the scene names. Throws
/// InputError for what isn't there, IoError.
Scene withEffectsOf(Scene scene, const PictureSource& source, Job& job);

}  // namespace tessera
