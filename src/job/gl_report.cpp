#include "job/gl_report.h"

#include <fmt/format.h>

#include <utility>

#include "gl/gl_platform.h"
#include "job/report_text.h"

namespace tessera {

namespace {

using Limit = std::pair<const char*, Json>;

/// The limits by the names that the JSON report has; the text shows them with spaces.
std::vector<Limit> limitList(const GlLimits& limits) {
    return {{"texture_2d_size", limits.texture2dSize},
            {"texture_3d_size", limits.texture3dSize},
            {"array_texture_layers", limits.arrayTextureLayers},
            {"texture_buffer_texels", limits.textureBufferTexels},
            {"framebuffer_layers", limits.framebufferLayers},
            {"framebuffer_size", Json::array({limits.framebufferWidth, limits.framebufferHeight})},
            {"color_attachments", limits.colorAttachments},
            {"draw_buffers", limits.drawBuffers},
            {"varying_components", limits.varyingComponents},
            {"vertex_attributes", limits.vertexAttributes},
            {"texture_units", limits.textureUnits},
            {"storage_block_bytes", limits.storageBlockBytes},
            {"vertex_storage_blocks", limits.vertexStorageBlocks},
            {"fragment_storage_blocks", limits.fragmentStorageBlocks},
            {"uniform_block_bytes", limits.uniformBlockBytes},
            {"subpixel_bits", limits.subpixelBits},
            {"point_size_range", Json::array({limits.minPointSize, limits.maxPointSize})}};
}

std::string valueText(const Json& value) {
    if (value.is_array()) return valueText(value[0]) + ", " + valueText(value[1]);
    return value.is_number_integer() ? formatCount(value.get<std::int64_t>())
                                     : fmt::format("{:.6g}", value.get<double>());
}

std::string words(std::string name) {
    for (char& letter : name)
        if (letter == '_') letter = ' ';
    return name;
}

/// A table with a column for each device.
template <class CellOf>
std::string tableOf(const std::vector<GlDeviceInfo>& devices, const std::string& heading,
                    const std::vector<std::string>& names, std::size_t width, const CellOf& cellOf) {
    std::vector<std::vector<std::string>> rows{{heading}};
    for (const GlDeviceInfo& device : devices) rows[0].emplace_back(nameOf(device.platform));
    for (std::size_t i = 0; i < names.size(); ++i) {
        rows.push_back({names[i]});
        for (const GlDeviceInfo& device : devices) rows.back().push_back(cellOf(device, i));
    }
    return formatTable(rows, width);
}

std::string limitsText(const std::vector<GlDeviceInfo>& devices, std::size_t width) {
    std::vector<std::string> names;
    for (const Limit& limit : limitList({})) names.push_back(words(limit.first));
    return tableOf(devices, "limit", names, width, [](const GlDeviceInfo& device, std::size_t i) {
        return valueText(limitList(device.limits)[i].second);
    });
}

std::string formatText(const GlFormat& format) {
    std::string text;
    for (const auto& [can, what] : {std::pair{format.isRenderable, "flat"},
                                    {format.isLayered3d, "3D"},
                                    {format.isLayeredArray, "array"},
                                    {format.isLayeredDepth, "3D with depth"}})
        if (can) text += (text.empty() ? "" : ", ") + std::string(what);
    return text.empty() ? "none" : text;
}

std::string formatsText(const std::vector<GlDeviceInfo>& devices, std::size_t width) {
    std::vector<std::string> names;
    for (const GlFormat& format : devices.front().formats) names.push_back(format.name);
    return tableOf(devices, "targets", names, width,
                   [](const GlDeviceInfo& device, std::size_t i) { return formatText(device.formats[i]); });
}

std::string deviceText(const GlDeviceInfo& info) {
    std::string text =
        fmt::format("  {}\n  {}, {}{}\n  OpenGL {}, GLSL {}\n", info.platformDetail, info.renderer,
                    info.vendor, info.isSoftware ? ", software" : "", info.version, info.shadingLanguage);
    text += fmt::format("  gl_Layer in vertex shaders: {}\n", info.hasVertexShaderLayer ? "yes" : "no");
    std::string extensions;
    for (const std::string& name : info.extensions) extensions += " " + name;
    return text + "  extensions:" + (extensions.empty() ? " none of interest" : extensions) + "\n";
}

Json deviceJson(const GlDeviceInfo& info) {
    Json limits, formats = Json::array();
    for (const auto& [name, value] : limitList(info.limits)) limits[name] = value;
    for (const GlFormat& format : info.formats)
        formats.push_back({{"name", format.name},
                           {"renderable", format.isRenderable},
                           {"layered_3d", format.isLayered3d},
                           {"layered_array", format.isLayeredArray},
                           {"layered_3d_with_depth", format.isLayeredDepth}});
    return {{"detail", info.platformDetail},
            {"vendor", info.vendor},
            {"renderer", info.renderer},
            {"version", info.version},
            {"shading_language", info.shadingLanguage},
            {"software", info.isSoftware},
            {"vertex_shader_layer", info.hasVertexShaderLayer},
            {"limits", limits},
            {"formats", formats},
            {"extensions", info.extensions}};
}

}  // namespace

std::string glText(std::size_t width) {
    std::string text, order;
    std::vector<GlDeviceInfo> devices;
    for (const GlPlatform platform : availableGlPlatforms())
        if (openGlDevice(platform).empty())
            order += (order.empty() ? "" : ", ") + std::string(nameOf(platform));
    for (const GlPlatform platform : glPlatforms()) {
        const std::string& reason = openGlDevice(platform);
        text += fmt::format("{}: {}\n", nameOf(platform), reason.empty() ? "available" : "no, " + reason);
        if (!reason.empty()) continue;
        devices.push_back(glDeviceInfo(platform));
        text += deviceText(devices.back());
    }
    text += fmt::format("order of preference: {}\n", order.empty() ? "none is available" : order);
    return devices.empty() ? text : text + limitsText(devices, width) + formatsText(devices, width);
}

Json glJson() {
    Json platforms = Json::array(), order = Json::array();
    for (const GlPlatform platform : availableGlPlatforms())
        if (openGlDevice(platform).empty()) order.push_back(nameOf(platform));
    for (const GlPlatform platform : glPlatforms()) {
        const std::string& reason = openGlDevice(platform);
        Json entry{{"name", nameOf(platform)}, {"available", reason.empty()}};
        if (reason.empty())
            entry["device"] = deviceJson(glDeviceInfo(platform));
        else
            entry["reason"] = reason;
        platforms.push_back(entry);
    }
    return {{"platforms", platforms}, {"preference", order}};
}

}  // namespace tessera
