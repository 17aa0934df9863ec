#include "job/program_presets.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "base/check.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// How a program reads OpenVDB files.
struct Program {
    const char* name;   ///< as typed after --for
    const char* title;  ///< as it calls itself
    const char* upAxis;
    /// Why no other axis can be given; empty: any can.
    const char* upAxisReason;
    int extendLayers;
    double voxelShift;
    const char *density, *velocity;  ///< names of grids that it looks for; empty: none
};

// All read one grid a field, so the layout is flat. A program is one line here; docs/vdb_layout.md says where
// the figures come from.
constexpr std::array kPrograms{
    // Draws voxel i around i + 1/2, isosurfaces along the file's axes and volumes along the grid's.
    Program{"blender", "Blender", "keep",
            "Blender shifts isosurfaces and volumes of a turned grid differently, so turn the object there",
            1, -0.5, "density", "velocity"},
    Program{"houdini", "Houdini", "y", "", 1, 0, "density", "vel"},
    // Leaves out the last layer of voxels on each axis.
    Program{"paraview", "ParaView", "keep", "ParaView takes no notice of a turned grid", 2, 0, "", ""},
};

const Program& findProgram(const std::string& name) {
    const auto found =
        std::find_if(kPrograms.begin(), kPrograms.end(), [&](const Program& p) { return name == p.name; });
    TESSERA_CHECK(found != kPrograms.end(), "--for takes the names in the table only");
    return *found;
}

bool isCalledVelocity(std::string name) {
    for (char& c : name) c = char(std::tolower(static_cast<unsigned char>(c)));
    return name == "velocity" || name == "vel" || name == "v" || name == "u";
}

}  // namespace

std::vector<std::string> programNames() {
    std::vector<std::string> names;
    for (const Program& program : kPrograms) names.emplace_back(program.name);
    return names;
}

ProgramChoices settleProgram(const std::string& programName, ProgramChoices c) {
    if (programName.empty()) return c;
    const Program& program = findProgram(programName);
    if (!c.layout.empty() && c.layout != "flat")
        throw InputError(
            fmt::format("--for {} goes with --layout flat: {} shows one grid a field, got "
                        "--layout {}",
                        program.name, program.title, c.layout));
    if (*program.upAxisReason && !c.upAxis.empty() && c.upAxis != program.upAxis)
        throw InputError(fmt::format("--for {} goes with --up-axis {}: {}, got --up-axis {}", program.name,
                                     program.upAxis, program.upAxisReason, c.upAxis));
    c.layout = "flat";
    if (c.upAxis.empty()) c.upAxis = program.upAxis;
    if (!c.extendLayers) c.extendLayers = program.extendLayers;
    if (!c.voxelShift) c.voxelShift = program.voxelShift;
    return c;
}

std::string nameFields(std::vector<OutputField>& outputs, const std::vector<FieldChoice>& choices,
                       const std::string& programName) {
    if (programName.empty()) return {};
    const Program& program = findProgram(programName);
    std::string text;
    const auto give = [&](const std::string& name, const auto& fits) {
        if (name.empty()) return;
        for (const OutputField& output : outputs)
            if (output.name == name) return;
        for (std::size_t f = 0; f < outputs.size(); ++f) {
            if ((!choices.empty() && choices[f].named) || !fits(outputs[f])) continue;
            text += fmt::format(
                "  {} is written as grid {}, the name that {} looks for (--field {}=name gives "
                "another)\n",
                outputs[f].name, name, program.title, outputs[f].sourceName);
            outputs[f].name = name;
            return;
        }
    };
    give(program.density, [](const OutputField& o) { return o.components == 1; });
    give(program.velocity,
         [](const OutputField& o) { return o.components == 3 && isCalledVelocity(o.sourceName); });
    return text;
}

}  // namespace tessera
