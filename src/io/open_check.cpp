#include "io/open_check.h"

#include <vtk_cgns.h>
#include <vtk_exodusII.h>
#include <vtk_netcdf.h>
#include VTK_CGNS(cgns_io.h)

#include <array>

#include "base/error.h"

namespace tessera {

void checkExodusFile(const std::string& path) {
    // The Exodus library prints when it can't open a file, whatever its options say; the one below doesn't.
    int dataset = 0;
    if (const int error = nc_open(path.c_str(), NC_NOWRITE, &dataset); error != NC_NOERR)
        throw InputError(path + ": damaged: the NetCDF library can't open it: " + nc_strerror(error));
    nc_close(dataset);
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

void checkCgnsFile(const std::string& path) {
    int file = 0;
    double root = 0;
    const bool opened = cgio_open_file(path.c_str(), CGIO_MODE_READ, CGIO_FILE_NONE, &file) == 0;
    if (opened && cgio_get_root_id(file, &root) == 0) {
        cgio_close_file(file);
        return;
    }
    std::array<char, CGIO_MAX_ERROR_LENGTH + 1> message{};
    cgio_error_message(message.data());
    if (opened) cgio_close_file(file);
    throw InputError(path + ": damaged: the CGNS library can't open it: " + message.data());
}

}  // namespace tessera
