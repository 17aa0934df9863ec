// Input: a NetCDF file of the classic formats.

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "base/check.h"
#include "fuzz_tools.h"
#include "mesh_files/netcdf_check.h"

namespace tessera {
namespace {

/// A file in memory.
class MemoryFile {
  public:
    MemoryFile() : descriptor_(::memfd_create("fuzz", 0)) {
        TESSERA_CHECK(descriptor_ >= 0, "memory serves as a file");
    }
    ~MemoryFile() { ::close(descriptor_); }
    MemoryFile(const MemoryFile&) = delete;
    MemoryFile& operator=(const MemoryFile&) = delete;

    std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }
    void hold(const std::uint8_t* data, std::size_t size) const {
        const bool held =
            ::ftruncate(descriptor_, 0) == 0 && ::pwrite(descriptor_, data, size, 0) == ssize_t(size);
        TESSERA_CHECK(held, "memory serves as a file");
    }
    void grow(std::size_t size) const {
        TESSERA_CHECK(::ftruncate(descriptor_, off_t(size)) == 0, "memory serves as a file");
    }

  private:
    int descriptor_;
};

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const tessera::MemoryFile file;
    file.hold(data, size);
    tessera::fuzz::expectInputErrorsOnly([&] {
        tessera::checkNetcdfSize(file.path());
        file.grow(size + 4096);
        try {
            tessera::checkNetcdfSize(file.path());
        } catch (const tessera::InputError&) {
            TESSERA_CHECK(false, "a longer file is long enough, too");
        }
    });
    return 0;
}
