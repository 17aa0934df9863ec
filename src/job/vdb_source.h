#pragma once

#include <memory>
#include <optional>
#include <string>

#include "gl/gl_thread.h"
#include "job/job.h"
#include "job/picture_source.h"

namespace tessera {

/// One field of a .vdb file, or one component of it; of a vector without a component the length. Says what a
/// file lacks that pictures need. @param field empty: the first. Throws InputError for one that isn't there,
/// and a file without a value in the mesh, IoError, GlError.
std::unique_ptr<PictureSource> openVdbSource(const std::string& path, const std::string& field,
                                             std::optional<int> component, GlThread& thread, Job& job);

}  // namespace tessera
