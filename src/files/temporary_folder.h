#pragma once

#include <string>

namespace tessera {

/// A fresh folder that only this user can enter, among the system's temporary files (TMPDIR). It is removed
/// with all that it holds when this object ends.
class TemporaryFolder {
  public:
    /// Throws IoError. @param prefix of its name.
    explicit TemporaryFolder(const std::string& prefix);
    ~TemporaryFolder();
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;

    const std::string& path() const { return path_; }
    std::string pathOf(const std::string& file) const { return path_ + "/" + file; }

  private:
    std::string path_;
};

}  // namespace tessera
