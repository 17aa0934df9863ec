#pragma once

#include <atomic>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "base/child_process.h"
#include "tessera/execution.h"

namespace tessera {

/// How long a peer may take to read the mesh, and for each request.
inline constexpr double kPeerTimeoutMs = 600e3;

/// A program that samples meshes, and how to start it.
struct PeerCommand {
    std::string name;     ///< in tables and plots
    std::string command;  ///< a program and its arguments as in /bin/sh; the mesh's path comes behind them
    double timeoutMs = kPeerTimeoutMs;
    /// Ends the wait for a peer that starts, when it turns true; may be null.
    const std::atomic<bool>* cancel = nullptr;
};

/// A running peer, spoken to in lines of JSON over its standard input and output: docs/benchmark_peers.md.
/// What it starts in its turn belongs to it. When this object ends, its input ends; if it then doesn't, it is
/// killed. A peer that failed once is stopped, and every later call fails with the same words.
class PeerProcess {
  public:
    /// Starts the command and waits until it has read the mesh. Throws IoError when it can't be started, and
    /// as ask() does. @param logPath gets its standard error.
    PeerProcess(const PeerCommand& peer, const std::string& meshPath, std::string logPath);
    ~PeerProcess();
    PeerProcess(const PeerProcess&) = delete;
    PeerProcess& operator=(const PeerProcess&) = delete;

    /// The peer's own name and version, as it says.
    const std::string& title() const { return title_; }

    /// Sends a request and waits for the answer: milliseconds that the peer says its sampling took, or that
    /// passed until its answer where it doesn't say. Throws IoError when it ends, says something else or
    /// nothing in time, and Cancelled; IoError too when it answers with an error, after which it goes on.
    double ask(const nlohmann::ordered_json& request, const Execution& execution);

    /// Stops the peer. Throws IoError: "the peer NAME: expected EXPECTED, but CAME", and what its standard
    /// error ends with.
    [[noreturn]] void fail(const std::string& expected, const std::string& came);

  private:
    void start(const std::string& meshPath);
    std::string exchange(std::string unsent, const std::string& expected, const Execution& execution);
    void send(std::string& unsent);
    void receive(const std::string& expected);
    std::optional<std::string> takeLine(const std::string& expected);
    nlohmann::ordered_json parse(const std::string& line, const std::string& expected);
    void stop(const std::string& why);
    std::string sentence(const std::string& expected, const std::string& came) const;
    std::string lastWords() const;

    PeerCommand peer_;
    std::string logPath_, title_;
    std::string received_;  ///< of lines that haven't been taken
    std::string failure_;   ///< empty while it runs
    Descriptor socket_;
    std::optional<ChildProcess> child_;
};

}  // namespace tessera
