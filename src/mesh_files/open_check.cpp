#include "mesh_files/open_check.h"

#include <vtk_cgns.h>
#include <vtk_exodusII.h>
#include <vtk_hdf5.h>
#include <vtk_netcdf.h>
#include VTK_CGNS(cgns_io.h)
#include VTK_CGNS(cgnslib.h)

#include <algorithm>
#include <array>
#include <cstdint>

#include "files/input_file.h"
#include "files/named_file.h"
#include "mesh_files/netcdf_check.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kNodesAtOnce = 1 << 20;
constexpr int kDeepestNode = 64, kMostChildren = 1 << 20;

/// A NetCDF file that is open. What isn't there has length -1.
class NetcdfFile {
  public:
    explicit NetcdfFile(const std::string& path) : path_(path) {
        if (const int error = nc_open(path.c_str(), NC_NOWRITE, &id_); error != NC_NOERR)
            throw InputError(path + ": damaged: the NetCDF library can't open it: " + nc_strerror(error));
    }
    ~NetcdfFile() { nc_close(id_); }
    NetcdfFile(const NetcdfFile&) = delete;
    NetcdfFile& operator=(const NetcdfFile&) = delete;

    int id() const { return id_; }
    int variableCount() const {
        int count = 0;
        return nc_inq_nvars(id_, &count) == NC_NOERR ? count : 0;
    }
    std::string nameOf(int variable) const {
        std::array<char, NC_MAX_NAME + 1> name{};
        return nc_inq_varname(id_, variable, name.data()) == NC_NOERR ? name.data() : std::string();
    }
    std::int64_t length(const std::string& dimension) const {
        int found = 0;
        return nc_inq_dimid(id_, dimension.c_str(), &found) == NC_NOERR ? length(found) : -1;
    }
    std::vector<std::int64_t> lengths(int variable) const {
        int count = 0;
        if (nc_inq_varndims(id_, variable, &count) != NC_NOERR) return {};
        std::vector<int> dimensions(std::size_t(count) + 1);
        if (nc_inq_vardimid(id_, variable, dimensions.data()) != NC_NOERR) return {};
        std::vector<std::int64_t> found;
        for (int d = 0; d < count; ++d) found.push_back(length(dimensions[std::size_t(d)]));
        return found;
    }
    [[noreturn]] void fail(const std::string& what) const { throw InputError(path_ + ": damaged: " + what); }

  private:
    std::int64_t length(int dimension) const {
        std::size_t found = 0;
        return nc_inq_dimlen(id_, dimension, &found) == NC_NOERR ? std::int64_t(found) : -1;
    }

    std::string path_;
    int id_ = 0;
};

/// Throws InputError for a list of elements that the Exodus library, which trusts its shape, would read past
/// its memory, or that names a node which isn't there.
/// @param block the number behind "connect".
void checkElements(const NetcdfFile& file, int variable, const std::string& block, std::int64_t nodes) {
    std::size_t typeLength = 0;
    if (nc_inq_attlen(file.id(), variable, "elem_type", &typeLength) == NC_NOERR &&
        typeLength > MAX_STR_LENGTH)
        file.fail("the type of element block " + block + " has a name of " + std::to_string(typeLength) +
                  " bytes");
    const std::vector<std::int64_t> lengths = file.lengths(variable);
    if (lengths.size() == 1) return;  // polygons and polyhedra, which aren't read
    const std::int64_t elements = file.length("num_el_in_blk" + block);
    const std::int64_t perElement = file.length("num_nod_per_el" + block);
    if (lengths != std::vector{elements, perElement})
        file.fail("the nodes of element block " + block + " aren't a table of its elements");
    if (elements < 1 || perElement < 1) return;
    const std::int64_t step = std::max<std::int64_t>(1, kNodesAtOnce / perElement);
    std::vector<long long> list;
    for (std::int64_t first = 0; first < elements; first += step) {
        const std::int64_t count = std::min(step, elements - first);
        list.resize(std::size_t(count * perElement));
        const std::array<std::size_t, 2> start{std::size_t(first), 0};
        const std::array<std::size_t, 2> counts{std::size_t(count), std::size_t(perElement)};
        if (const int error =
                nc_get_vara_longlong(file.id(), variable, start.data(), counts.data(), list.data());
            error != NC_NOERR)
            file.fail("the nodes of element block " + block + " can't be read: " + nc_strerror(error));
        for (std::size_t i = 0; i < list.size(); ++i)
            if (list[i] < 1 || list[i] > nodes)
                file.fail("element " + std::to_string(first + std::int64_t(i) / perElement + 1) +
                          " of block " + block + " (both counted from 1) names node " +
                          std::to_string(list[i]) + "; there are " + std::to_string(nodes));
    }
}

/// VTK's reader looks blocks up by their numbers.
void checkBlockNumbers(const NetcdfFile& file, int variable) {
    const std::int64_t blocks = file.length("num_el_blk");
    if (file.lengths(variable) != std::vector{blocks})
        file.fail("the list of element blocks hasn't the length that is declared");
    std::vector<long long> numbers(std::size_t(std::max<std::int64_t>(0, blocks)));
    if (const int error = nc_get_var_longlong(file.id(), variable, numbers.data()); error != NC_NOERR)
        file.fail(std::string("the list of element blocks can't be read: ") + nc_strerror(error));
    std::sort(numbers.begin(), numbers.end());
    const auto twice = std::adjacent_find(numbers.begin(), numbers.end());
    if (twice != numbers.end())
        file.fail("two of its element blocks have the number " + std::to_string(*twice));
}

void checkElements(const NetcdfFile& file) {
    const std::int64_t nodes = std::max<std::int64_t>(0, file.length("num_nodes"));
    for (int variable = 0; variable < file.variableCount(); ++variable) {
        const std::string name = file.nameOf(variable), table = "connect";
        if (name == "eb_prop1") checkBlockNumbers(file, variable);
        if (!name.starts_with(table) || name.size() == table.size()) continue;
        const std::string block = name.substr(table.size());
        if (block.find_first_not_of("0123456789") == std::string::npos)
            checkElements(file, variable, block, nodes);
    }
}

/// Adds the names of the zone's fields.
void listFields(int file, int base, int zone, CgnsFields& fields) {
    int solutions = 0;
    if (cg_nsols(file, base, zone, &solutions) != 0) return;
    std::array<char, 64> name{};
    int pointSolutions = 0, cellSolutions = 0;
    for (int s = 1; s <= solutions; ++s) {
        CGNS_ENUMT(GridLocation_t) location{};
        int count = 0;
        if (cg_sol_info(file, base, zone, s, name.data(), &location) != 0) continue;
        if (cg_nfields(file, base, zone, s, &count) != 0) continue;
        pointSolutions += location == CGNS_ENUMV(Vertex);
        cellSolutions += location == CGNS_ENUMV(CellCenter);
        for (int f = 1; f <= count; ++f) {
            CGNS_ENUMT(DataType_t) type{};
            if (cg_field_info(file, base, zone, s, f, &type, name.data()) != 0) continue;
            if (location == CGNS_ENUMV(Vertex)) fields.atPoints.emplace_back(name.data());
            if (location == CGNS_ENUMV(CellCenter)) fields.atCells.emplace_back(name.data());
        }
    }
    // Those of the steps of a series are told apart by data that a zone has for them.
    const bool isSeries = cg_ziter_read(file, base, zone, name.data()) == 0;
    if (isSeries || (pointSolutions < 2 && cellSolutions < 2)) return;
    std::array<cgsize_t, 9> size{};
    cg_zone_read(file, base, zone, name.data(), size.data());
    fields.warnings.push_back("Zone '" + std::string(name.data()) +
                              "' has several solutions at its points or in its cells; one at each is read.");
}

/// None where the library above cgio, which is stricter, can't open the file.
CgnsFields listFields(const std::string& path) {
    CgnsFields fields;
    int file = 0, bases = 0;
    if (cg_open(path.c_str(), CG_MODE_READ, &file) != 0) return fields;
    if (cg_nbases(file, &bases) != 0) bases = 0;
    for (int base = 1; base <= bases; ++base) {
        int zones = 0;
        if (cg_nzones(file, base, &zones) != 0) continue;
        for (int zone = 1; zone <= zones; ++zone) listFields(file, base, zone, fields);
    }
    cg_close(file);
    return fields;
}

/// @param data a string: what of an HDF5 file reads another one; stays empty where nothing does.
herr_t visitLink(hid_t group, const char* name, const H5L_info_t* info, void* data) {
    auto& found = *static_cast<std::string*>(data);
    if (info->type == H5L_TYPE_EXTERNAL || info->type >= H5L_TYPE_UD_MIN) {
        found = std::string("a link to another file, ") + name;
        return 1;
    }
    if (info->type != H5L_TYPE_HARD) return 0;
    const hid_t object = H5Oopen(group, name, H5P_DEFAULT);
    if (object < 0) return 0;
    if (H5Iget_type(object) == H5I_DATASET) {
        const hid_t plan = H5Dget_create_plist(object);
        if (plan >= 0 && (H5Pget_external_count(plan) > 0 || H5Pget_layout(plan) == H5D_VIRTUAL))
            found = std::string("values in another file, of ") + name;
        H5Pclose(plan);
    }
    H5Oclose(object);
    return found.empty() ? 0 : 1;
}

/// Links of the older kind of CGNS files, and names of files in those of HDF5.
std::string findCgnsLink(int file, double node, int depth) {
    int length = 0;
    if (depth > kDeepestNode) return "nodes in more than 64 levels";
    if (cgio_is_link(file, node, &length) != 0) return {};
    if (length > 0) {
        int fileLength = 0, nodeLength = 0;
        if (cgio_link_size(file, node, &fileLength, &nodeLength) == 0 && fileLength > 0)
            return "a link to another file";
        return {};
    }
    int children = 0, got = 0;
    if (cgio_number_children(file, node, &children) != 0 || children <= 0) return {};
    std::vector<double> ids(std::size_t(std::min(children, kMostChildren)));
    if (cgio_children_ids(file, node, 1, int(ids.size()), &got, ids.data()) != 0) return {};
    for (int c = 0; c < got; ++c)
        if (std::string link = findCgnsLink(file, ids[std::size_t(c)], depth + 1); !link.empty()) return link;
    return {};
}

[[noreturn]] void refuseLink(const std::string& path, const std::string& what) {
    throw InputError(path + ": holds " + what + kFollowLinksHint);
}

}  // namespace

void refuseLinks(const std::string& path) {
    const std::string magic = InputFile(path).copy(0, 8);
    if (magic == "\x89HDF\r\n\x1a\n") {
        H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
        const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
        if (file < 0) return;  // the reader will say why
        std::string found;
        H5Lvisit(file, H5_INDEX_NAME, H5_ITER_NATIVE, visitLink, &found);
        H5Fclose(file);
        if (!found.empty()) refuseLink(path, found);
        return;
    }
    int file = 0;
    double root = 0;
    if (magic.starts_with("CDF") || cgio_open_file(path.c_str(), CGIO_MODE_READ, CGIO_FILE_NONE, &file) != 0)
        return;
    const std::string link = cgio_get_root_id(file, &root) == 0 ? findCgnsLink(file, root, 0) : std::string();
    cgio_close_file(file);
    if (!link.empty()) refuseLink(path, link);
}

void checkExodusFile(const std::string& path) {
    // The Exodus library prints when it can't open a file, whatever its options say; the one below doesn't.
    checkNetcdfSize(path);
    checkElements(NetcdfFile(path));
    ex_opts(0);
    int computeWordSize = 8, fileWordSize = 0;
    float version = 0;
    const int file = ex_open(path.c_str(), EX_READ, &computeWordSize, &fileWordSize, &version);
    if (file < 0) throw InputError(path + ": damaged: the Exodus library can't open it");
    ex_init_params parameters{};
    const int status = ex_get_init_ext(file, &parameters);
    ex_close(file);
    if (status < 0) throw InputError(path + ": damaged: the Exodus library finds no mesh in it");
}

CgnsFields checkCgnsFile(const std::string& path) {
    int file = 0;
    double root = 0;
    const bool opened = cgio_open_file(path.c_str(), CGIO_MODE_READ, CGIO_FILE_NONE, &file) == 0;
    if (opened && cgio_get_root_id(file, &root) == 0) {
        cgio_close_file(file);
        return listFields(path);
    }
    std::array<char, CGIO_MAX_ERROR_LENGTH + 1> message{};
    cgio_error_message(message.data());
    if (opened) cgio_close_file(file);
    throw InputError(path + ": damaged: the CGNS library can't open it: " + message.data());
}

}  // namespace tessera
