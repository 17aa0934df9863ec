#include "io/mapped_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace tessera {

MappedFile::MappedFile(const std::string& path) {
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0) {
        if (errno == ENOENT || errno == ENOTDIR) throw InputError(path + ": there is no such file");
        throw InputError(path + ": can't be read: " + std::strerror(errno));
    }
    if (S_ISDIR(status.st_mode)) throw InputError(path + ": is a directory, expected a mesh file");
    if (!S_ISREG(status.st_mode)) throw InputError(path + ": isn't a regular file");
    if (status.st_size == 0) throw InputError(path + ": the file is empty");
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) throw InputError(path + ": can't be read: " + std::strerror(errno));
    const auto size = std::size_t(status.st_size);
    void* memory = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
    const int error = errno;
    ::close(file);
    if (memory == MAP_FAILED) throw InputError(path + ": can't be read: " + std::strerror(error));
    bytes_ = {static_cast<const char*>(memory), size};
}

MappedFile::~MappedFile() {
    ::munmap(const_cast<char*>(bytes_.data()), bytes_.size());
}

}  // namespace tessera
