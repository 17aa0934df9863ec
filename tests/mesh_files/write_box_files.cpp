// usage: write_box_files FOLDER
// Writes the mesh of box_files.h into FOLDER/FORMAT/CASE, every variant of every format.

#include <vtk_exodusII.h>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>

#include "mesh_files/box_files.h"

namespace {

using namespace tessera::test;

void writeAll(const std::string& folder) {
    const auto caseFolder = [&](const char* format, const std::string& variant) {
        const std::string path = folder + "/" + format + "/" + variant;
        std::filesystem::create_directories(path);
        return path + "/";
    };
    for (const auto& [variant, mode] : {std::pair("classic", EX_CLOBBER),
                                        {"64-bit", EX_CLOBBER | EX_64BIT_OFFSET},
                                        {"netcdf-4", EX_CLOBBER | EX_NETCDF4}})
        writeExodus(caseFolder("exodus", variant) + "box.ex2", mode);
    for (const auto& [kind, number] : {std::pair("adf", CG_FILE_ADF), {"hdf5", CG_FILE_HDF5}}) {
        const std::string prefix = std::string(kind) + "-";
        writeCgnsUnstructured(caseFolder("cgns", prefix + "cells") + "box.cgns", number);
        writeCgnsStructured(caseFolder("cgns", prefix + "grid") + "box.cgns", number);
        writeCgnsPolyhedron(caseFolder("cgns", prefix + "polyhedron") + "box.cgns", number);
    }
    for (const auto& [name, encoding] : {std::pair("text", Encoding::text), {"binary", Encoding::binary}}) {
        const std::string suffix = std::string("-") + name;
        writeEnSight(caseFolder("ensight", "gold" + suffix), EnSightVersion::gold, encoding);
        writeEnSight(caseFolder("ensight", "six" + suffix), EnSightVersion::six, encoding);
        const std::string foam = caseFolder("openfoam", name);
        writeFoamMesh(foam, "", encoding);
        writeFoamFields(foam, "", encoding);
        std::ofstream(foam + "box.foam").flush();
    }
    const std::string regions = caseFolder("openfoam", "regions");
    for (const char* region : {"fluid/", "solid/"}) {
        writeFoamMesh(regions, region);
        writeFoamFields(regions, region);
    }
    std::ofstream(regions + "box.foam").flush();
}

}  // namespace

int main(int count, char** words) {
    if (count != 2) {
        std::fputs("usage: write_box_files FOLDER\n", stderr);
        return 2;
    }
    try {
        writeAll(words[1]);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "write_box_files: %s\n", error.what());
        return 1;
    }
    return 0;
}
