#pragma once

#include <string>
#include <vector>

#include "files/json_node.h"
#include "scene/scene.h"

namespace tessera {

/// Reads a scene: docs/viewer.md tells its keys, docs/scene.schema.json is their schema. Throws InputError
/// with the file and the place in it for whatever is wrong or unknown, IoError.
Scene readScene(const std::string& path);
/// The same of what was read.
Scene sceneFrom(const JsonNode& json);

/// The stops of a transfer function: [{"value": 0.2, "color": [1, 0.5, 0], "opacity": 0.3}, ...]. "color" may
/// be left out, white. Throws InputError.
std::vector<TransferFunction::Stop> readStops(const JsonNode& json);

}  // namespace tessera
