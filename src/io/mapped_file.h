#pragma once

#include <string>
#include <string_view>

namespace tessera {

/// A regular file as read-only memory. Throws InputError when it is missing, not a regular file, empty or not
/// readable.
class MappedFile {
  public:
    explicit MappedFile(const std::string& path);
    ~MappedFile();
    MappedFile(const MappedFile&) = delete;
    MappedFile& operator=(const MappedFile&) = delete;

    std::string_view bytes() const { return bytes_; }

  private:
    std::string_view bytes_;
};

}  // namespace tessera
