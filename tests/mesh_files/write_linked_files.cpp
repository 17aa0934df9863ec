// usage: write_linked_files OUTSIDE FOLDER
// Writes marked files into OUTSIDE, and into FOLDER/CASE Exodus and CGNS files whose values lie in those: by
// links to files, values in other files, virtual datasets. Both names must be absolute. The marked value is
// 1234.5.

#include <vtk_exodusII.h>
#include <vtk_hdf5.h>

#include <array>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "mesh_files/box_files.h"

namespace {

using namespace tessera::test;
namespace fs = std::filesystem;

constexpr double kMarked = 1234.5;
constexpr int kSteps = 2;

void check(herr_t status) {
    if (status < 0) throw std::runtime_error("the HDF5 library failed");
}

/// One dataset of a file, which holds values at the nodes.
struct Place {
    const char* fileName;
    const char* format;
    std::string dataset;
    hsize_t values;
    bool isTable;  ///< steps by nodes

    std::string folder() const { return fs::path(dataset).parent_path().string(); }
};
const Place kExodus{"box.ex2", "exodus", "/vals_nod_var1", kSteps* kNodes, true};
const Place kCgns{"box.cgns", "cgns", "/Base/Zone/Nodes/Temperature/ data", kNodes, false};

void writeSound(const Place& place, const std::string& path) {
    if (place.isTable)
        writeExodus(path, EX_CLOBBER | EX_NETCDF4);
    else
        writeCgnsUnstructured(path, CG_FILE_HDF5);
}

class OpenFile {
  public:
    explicit OpenFile(const std::string& path) : id(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT)) {
        check(herr_t(id));
    }
    ~OpenFile() { H5Fclose(id); }
    OpenFile(const OpenFile&) = delete;
    OpenFile& operator=(const OpenFile&) = delete;
    const hid_t id;
};

void writeMarked(const Place& place, const std::string& path) {
    writeSound(place, path);
    const OpenFile file(path);
    const hid_t dataset = H5Dopen2(file.id, place.dataset.c_str(), H5P_DEFAULT);
    const std::vector<double> values(place.values, kMarked);
    check(H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
    H5Dclose(dataset);
}

/// A dataset in the place of the one that was there, as `plan` wants it; its attributes are kept.
void replaceDataset(const Place& place, hid_t file, hid_t plan) {
    const hid_t old = H5Dopen2(file, place.dataset.c_str(), H5P_DEFAULT);
    check(H5Lmove(file, place.dataset.c_str(), file, (place.dataset + "_old").c_str(), H5P_DEFAULT,
                  H5P_DEFAULT));
    const std::array<hsize_t, 2> table{kSteps, kNodes};
    const hid_t space = place.isTable ? H5Screate_simple(2, table.data(), nullptr)
                                      : H5Screate_simple(1, &place.values, nullptr);
    const hid_t dataset =
        H5Dcreate2(file, place.dataset.c_str(), H5T_IEEE_F64LE, space, H5P_DEFAULT, plan, H5P_DEFAULT);
    check(herr_t(dataset));
    H5Dclose(dataset);
    H5Sclose(space);
    H5Dclose(old);
    check(H5Ldelete(file, (place.dataset + "_old").c_str(), H5P_DEFAULT));
}

void storeOutside(const Place& place, hid_t file, const std::string& values) {
    const hid_t plan = H5Pcreate(H5P_DATASET_CREATE);
    check(H5Pset_external(plan, values.c_str(), 0, place.values * sizeof(double)));
    replaceDataset(place, file, plan);
    H5Pclose(plan);
}

void mapOutside(const Place& place, hid_t file, const std::string& other) {
    const std::array<hsize_t, 2> table{kSteps, kNodes};
    const hid_t space = place.isTable ? H5Screate_simple(2, table.data(), nullptr)
                                      : H5Screate_simple(1, &place.values, nullptr);
    const hid_t plan = H5Pcreate(H5P_DATASET_CREATE);
    check(H5Pset_virtual(plan, space, other.c_str(), place.dataset.c_str(), space));
    replaceDataset(place, file, plan);
    H5Pclose(plan);
    H5Sclose(space);
}

void linkOutside(hid_t file, const std::string& what, const std::string& other) {
    check(H5Ldelete(file, what.c_str(), H5P_DEFAULT));
    check(H5Lcreate_external(other.c_str(), what.c_str(), file, what.c_str(), H5P_DEFAULT, H5P_DEFAULT));
}

/// By a soft link to a group that is one to the other file.
void linkSoftly(const Place& place, hid_t file, const std::string& other) {
    check(H5Ldelete(file, place.dataset.c_str(), H5P_DEFAULT));
    check(H5Lcreate_external(other.c_str(), "/", file, "/hidden", H5P_DEFAULT, H5P_DEFAULT));
    check(H5Lcreate_soft(("/hidden" + place.dataset).c_str(), file, place.dataset.c_str(), H5P_DEFAULT,
                         H5P_DEFAULT));
}

void writeLinkedHdf5(const Place& place, const std::string& outside, const std::string& folder) {
    const std::string marked = outside + "/marked_" + place.fileName, values = outside + "/marked.bin";
    writeMarked(place, marked);
    const auto add = [&](const char* name, const auto& change) {
        const std::string where = folder + "/" + place.format + "-" + name;
        fs::create_directories(where);
        writeSound(place, where + "/" + place.fileName);
        change(OpenFile(where + "/" + place.fileName).id, where);
    };
    const std::string near = "../../outside/";
    add("link-absolute", [&](hid_t file, const std::string&) { linkOutside(file, place.dataset, marked); });
    add("link-above", [&](hid_t file, const std::string&) {
        linkOutside(file, place.dataset, near + "marked_" + place.fileName);
    });
    add("link-through-folder", [&](hid_t file, const std::string& where) {
        fs::create_directory_symlink(outside, where + "/sub");
        linkOutside(file, place.dataset, std::string("sub/marked_") + place.fileName);
    });
    add("soft-link", [&](hid_t file, const std::string&) { linkSoftly(place, file, marked); });
    add("values-absolute", [&](hid_t file, const std::string&) { storeOutside(place, file, values); });
    add("values-link", [&](hid_t file, const std::string& where) {
        fs::create_symlink(values, where + "/values.bin");
        storeOutside(place, file, where + "/values.bin");
    });
    add("virtual", [&](hid_t file, const std::string&) { mapOutside(place, file, marked); });
    if (place.isTable) return;
    add("link-of-group", [&](hid_t file, const std::string&) { linkOutside(file, place.folder(), marked); });
}

/// By the CGNS library's own links.
void writeLinkedCgns(const std::string& outside, const std::string& folder) {
    for (const auto& [kind, name] : {std::pair(CG_FILE_ADF, "adf"), {CG_FILE_HDF5, "hdf5"}}) {
        const std::string marked = outside + "/marked_" + name + ".cgns";
        writeCgnsUnstructured(marked, kind);
        int file = 0, written = 0;
        checkCgns(cg_open(marked.c_str(), CG_MODE_MODIFY, &file));
        const std::vector<double> values(kNodes, kMarked);
        checkCgns(
            cg_field_write(file, 1, 1, 1, CGNS_ENUMV(RealDouble), "Temperature", values.data(), &written));
        checkCgns(cg_close(file));
        for (const auto& [variant, target] :
             {std::pair<std::string, std::string>("absolute", marked),
              {"above", "../../outside/marked_" + std::string(name) + ".cgns"},
              {"link", "inside.cgns"}}) {
            const std::string where = folder + "/cgns-" + name + "-" + variant;
            fs::create_directories(where);
            if (variant == "link") fs::create_symlink(marked, where + "/inside.cgns");
            writeCgnsUnstructured(where + "/box.cgns", kind);
            checkCgns(cg_open((where + "/box.cgns").c_str(), CG_MODE_MODIFY, &file));
            checkCgns(cg_goto(file, 1, "Zone_t", 1, "end"));
            checkCgns(cg_delete_node("Nodes"));
            checkCgns(cg_link_write("Nodes", target.c_str(), "/Base/Zone/Nodes"));
            checkCgns(cg_close(file));
        }
    }
}

void writeAll(const std::string& outside, const std::string& folder) {
    std::ofstream values(outside + "/marked.bin", std::ios::binary);
    for (int i = 0; i < kSteps * kNodes; ++i)
        values.write(reinterpret_cast<const char*>(&kMarked), sizeof kMarked);
    values.close();
    for (const Place& place : {kExodus, kCgns}) writeLinkedHdf5(place, outside, folder);
    writeLinkedCgns(outside, folder);
}

}  // namespace

int main(int count, char** words) {
    if (count != 3) {
        std::fputs("usage: write_linked_files OUTSIDE FOLDER\n", stderr);
        return 2;
    }
    try {
        writeAll(words[1], words[2]);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "write_linked_files: %s\n", error.what());
        return 1;
    }
    return 0;
}
