#include "io/open_check.h"

#include <vtk_cgns.h>
#include <vtk_exodusII.h>
#include <vtk_netcdf.h>
#include VTK_CGNS(cgns_io.h)
#include VTK_CGNS(cgnslib.h)

#include <algorithm>
#include <array>
#include <cstdint>

#include "base/error.h"
#include "io/netcdf_check.h"

namespace tessera {

namespace {

constexpr std::int64_t kNodesAtOnce = 1 << 20;

/// Throws InputError for an element of the block that names a node which isn't there. What can't be read, or
/// is no list of nodes, is left to VTK.
void checkElementNodes(const std::string& path, int file, std::int64_t id, std::int64_t nodes) {
    ex_block block{};
    block.id = id;
    block.type = EX_ELEM_BLOCK;
    if (ex_get_block_param(file, &block) < 0 || block.num_entry < 1 || block.num_nodes_per_entry < 1) return;
    const std::string topology = block.topology;
    if (topology.starts_with("nsided") || topology.starts_with("NSIDED") || topology.starts_with("nfaced") ||
        topology.starts_with("NFACED"))
        return;
    const std::int64_t perElement = block.num_nodes_per_entry;
    const std::int64_t step = std::max<std::int64_t>(1, kNodesAtOnce / perElement);
    std::vector<std::int64_t> list;
    for (std::int64_t first = 0; first < block.num_entry; first += step) {
        const std::int64_t count = std::min(step, block.num_entry - first);
        list.resize(std::size_t(count * perElement));
        if (ex_get_partial_conn(file, EX_ELEM_BLOCK, id, first + 1, count, list.data(), nullptr, nullptr) < 0)
            return;
        for (std::size_t i = 0; i < list.size(); ++i)
            if (list[i] < 1 || list[i] > nodes)
                throw InputError(path + ": element " +
                                 std::to_string(first + std::int64_t(i) / perElement + 1) +
                                 " (counted from 1) of block " + std::to_string(id) + " names node " +
                                 std::to_string(list[i]) + "; there are " + std::to_string(nodes));
    }
}

void checkElementNodes(const std::string& path, int file, const ex_init_params& parameters) {
    std::vector<std::int64_t> ids(std::size_t(std::max<std::int64_t>(0, parameters.num_elem_blk)));
    if (ids.empty() || ex_get_ids(file, EX_ELEM_BLOCK, ids.data()) < 0) return;
    for (const std::int64_t id : ids) checkElementNodes(path, file, id, parameters.num_nodes);
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

}  // namespace

void checkExodusFile(const std::string& path) {
    // The Exodus library prints when it can't open a file, whatever its options say; the one below doesn't.
    int dataset = 0;
    checkNetcdfSize(path);
    if (const int error = nc_open(path.c_str(), NC_NOWRITE, &dataset); error != NC_NOERR)
        throw InputError(path + ": damaged: the NetCDF library can't open it: " + nc_strerror(error));
    nc_close(dataset);
    ex_opts(0);
    int computeWordSize = 8, fileWordSize = 0;
    float version = 0;
    const int file = ex_open(path.c_str(), EX_READ, &computeWordSize, &fileWordSize, &version);
    if (file < 0) throw InputError(path + ": damaged: the Exodus library can't open it");
    ex_init_params parameters{};
    ex_set_int64_status(file, EX_ALL_INT64_API);
    const int status = ex_get_init_ext(file, &parameters);
    try {
        if (status < 0) throw InputError(path + ": damaged: the Exodus library finds no mesh in it");
        checkElementNodes(path, file, parameters);
    } catch (...) {
        ex_close(file);
        throw;
    }
    ex_close(file);
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
