#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace tessera {

/// A file descriptor that closes itself.
class Descriptor {
  public:
    explicit Descriptor(int number = -1) : number_(number) {}
    ~Descriptor() { close(); }
    Descriptor(Descriptor&& other) noexcept : number_(other.number_) { other.number_ = -1; }
    Descriptor& operator=(Descriptor&& other) noexcept;
    int get() const { return number_; }
    void close();

  private:
    int number_;
};

/// How a child ended.
struct ProcessEnd {
    std::string words;  ///< "crashed (signal 11, Segmentation fault)", "ended without a result (exit code 7)"
    bool bySignal = false;
    bool byProcessorLimit = false;  ///< the system's (ulimit -t)
    int exitCode = -1;              ///< -1: by a signal, or unknown
};

/// Throws IoError: "can't start the process that reads files: socket: Too many open files: at most ...".
/// @param error as errno has it.
[[noreturn]] void failToStart(const std::string& task, const std::string& what, int error);

/// What to start, and with what.
struct ChildStart {
    std::string task;  ///< for errors: "that reads files"
    std::string executable;
    std::vector<std::string> arguments;
    std::vector<int> descriptors;  ///< of this process; they become 3, 4, ... of the child
    std::string variable;          ///< "NAME=value" for an environment without NAME, or empty
    bool hasOwnGroup = false;      ///< what it starts in its turn is killed with it
};

/// A running child with nothing but the descriptors it is given; its standard streams lead nowhere, and it
/// doesn't see the terminal's signals. It is killed and reaped when this object ends.
class ChildProcess {
  public:
    /// Throws IoError when the program can't be started.
    explicit ChildProcess(const ChildStart& start);
    ~ChildProcess() { kill(); }
    ChildProcess(ChildProcess&& other) noexcept : child_(other.child_), hasOwnGroup_(other.hasOwnGroup_) {
        other.child_ = -1;
    }
    ChildProcess& operator=(ChildProcess&&) = delete;

    /// Processor time that the child has taken so far, of all its threads; 0 when it has ended.
    double processorSeconds() const;
    /// How it ended; none while it runs.
    std::optional<ProcessEnd> reap();
    /// The same of a child that is about to end, since it closed its descriptors. Kills it if it doesn't.
    ProcessEnd describeEnd();

  private:
    void kill();
    std::optional<ProcessEnd> reapSoon();

    pid_t child_ = -1;
    bool hasOwnGroup_ = false;
};

/// To be called first by such a child: ends this process with its parent, and leaves no core file.
void settleAsChild(std::int64_t parent);

}  // namespace tessera
