#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace tessera {

/// While it lives, keeps VTK's messages from the terminal and collects its errors, from readers, their
/// parsers and inner readers alike. VTK has one output window for the process, so only one capture lives at a
/// time; others wait.
class VtkMessages {
  public:
    VtkMessages();
    ~VtkMessages();
    VtkMessages(const VtkMessages&) = delete;
    VtkMessages& operator=(const VtkMessages&) = delete;

    /// What was said, without file names and addresses of VTK's source.
    std::vector<std::string> errors() const;
    std::vector<std::string> warnings() const;

  private:
    struct Impl;
    std::unique_lock<std::mutex> lock_;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
