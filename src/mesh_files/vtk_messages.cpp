#include "mesh_files/vtk_messages.h"

#include <vtkLogger.h>
#include <vtkObjectFactory.h>
#include <vtkOutputWindow.h>
#include <vtkSmartPointer.h>

#include <algorithm>
#include <cctype>

namespace tessera {

namespace {

std::mutex captureMutex;

/// Removes every " (0x1234)": addresses differ from run to run and tell a user nothing.
void dropPointers(std::string& message) {
    for (std::size_t begin; (begin = message.find("(0x")) != std::string::npos;) {
        const std::size_t end = message.find(')', begin);
        if (end == std::string::npos) break;
        if (begin > 0 && message[begin - 1] == ' ') --begin;
        message.erase(begin, end + 1 - begin);
    }
}

/// "ERROR: In reader.cxx, line 5\nvtkReader (0x1234): Text.\n\n" -> "Text."
std::string messageText(const char* text) {
    std::string message = text ? text : "";
    // A generic message has no object: "Generic Warning: In reader.cxx, line 5\nText.\n"
    const std::size_t source = message.find(": In ");
    const std::size_t sourceEnd = message.find('\n');
    if (source < sourceEnd && sourceEnd != std::string::npos &&
        message.substr(source, sourceEnd - source).find(", line ") != std::string::npos)
        message.erase(0, sourceEnd + 1);
    const std::size_t object = message.find("): ");
    if (object < message.find('\n')) message.erase(0, object + 3);
    // What follows is the dump of an object's members.
    message.erase(std::min(message.find("Debug: O"), message.size()));
    for (char& c : message)
        if (std::isspace(static_cast<unsigned char>(c))) c = ' ';
    dropPointers(message);
    while (!message.empty() && (message.back() == ' ' || message.back() == ':')) message.pop_back();
    return message;
}

class CollectingWindow : public vtkOutputWindow {
  public:
    static CollectingWindow* New();
    vtkTypeMacro(CollectingWindow, vtkOutputWindow);

    void DisplayText(const char*) override {}
    void DisplayErrorText(const char* text) override { add(errors, text); }
    void DisplayWarningText(const char* text) override { add(warnings, text); }
    void DisplayGenericWarningText(const char* text) override { add(warnings, text); }
    void DisplayDebugText(const char*) override {}

    std::vector<std::string> copy(const std::vector<std::string>& list) const {
        std::lock_guard lock(mutex_);
        return list;
    }

    std::vector<std::string> errors, warnings;

  private:
    void add(std::vector<std::string>& list, const char* text) {
        std::lock_guard lock(mutex_);  // VTK's own worker threads may report too
        if (list.size() < 100) list.push_back(messageText(text));
    }
    mutable std::mutex mutex_;
};
vtkStandardNewMacro(CollectingWindow);

}  // namespace

struct VtkMessages::Impl {
    vtkSmartPointer<vtkOutputWindow> before;
    vtkSmartPointer<CollectingWindow> window;
    vtkLogger::Verbosity verbosityBefore = vtkLogger::VERBOSITY_INFO;
};

VtkMessages::VtkMessages() : lock_(captureMutex), impl_(std::make_unique<Impl>()) {
    impl_->before = vtkOutputWindow::GetInstance();
    impl_->window = vtkSmartPointer<CollectingWindow>::New();
    vtkOutputWindow::SetInstance(impl_->window);
    impl_->verbosityBefore = vtkLogger::GetCurrentVerbosityCutoff();
    vtkLogger::SetStderrVerbosity(vtkLogger::VERBOSITY_OFF);
}

VtkMessages::~VtkMessages() {
    vtkLogger::SetStderrVerbosity(impl_->verbosityBefore);
    vtkOutputWindow::SetInstance(impl_->before);
}

std::vector<std::string> VtkMessages::errors() const {
    return impl_->window->copy(impl_->window->errors);
}
std::vector<std::string> VtkMessages::warnings() const {
    return impl_->window->copy(impl_->window->warnings);
}

}  // namespace tessera
