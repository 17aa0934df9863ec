#include "job/transfer_function_file.h"

#include "files/json_node.h"
#include "scene/scene_file.h"
#include "tessera/error.h"

namespace tessera {

TransferFunction readTransferFunction(const std::string& path) {
    const JsonNode json = JsonNode::read(path, "the transfer function");
    json.expectKeys({"field", "stops"});
    TransferFunction function;
    if (const auto field = json.find("field")) function.field = field->text();
    function.stops = readStops(json.at("stops"));
    return function;
}

}  // namespace tessera
