#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mesh_files/read_mesh.h"
#include "reader/reader_limits.h"

namespace tessera {

/// What the reading process has to say, mostly how reading ended.
enum class ReaderOutcome : std::uint32_t {
    stage,           ///< a Stage follows, as 8 bytes, which begins now
    limits,          ///< usual IsolationLimits for this file follow; then it reads
    answerInMemory,  ///< the answer's packet is in the shared memory
    answerFollows,   ///< it follows in the socket, where a limit on file sizes forbids the shared memory
    /// the file has a format that this program doesn't read; a message follows, also for the ones below
    otherFormat,
    inputError,
    ioError,
    internalError,
    otherError,
    overLimit,    ///< the memory limit was reached
    outOfMemory,  ///< the memory that the parent itself may use was reached
};

/// Stands before the message or the answer in the socket.
struct ReportStart {
    static constexpr std::uint32_t kMagic = 0x54737373;
    std::uint32_t magic = kMagic;
    ReaderOutcome outcome = ReaderOutcome::otherError;
    std::uint64_t bytes = 0;  ///< that follow
};

/// What the reading process needs to know.
struct ReaderRequest {
    std::int64_t parent = 0;       ///< process that waits for the answer
    std::int64_t memoryBytes = 0;  ///< it may take; 0: the usual limit
    int threads = 0;
    std::string path;
    ReadOptions options;
    std::string task = "mesh";  ///< ReaderTask::name
    std::string body{};         ///< what a task needs to know beyond that
};

/// Of the process that is started: the protocol and its parent. The rest comes through the socket.
std::vector<std::string> startWords(std::int64_t parent);
/// Its parent. Throws InputError when nothing else started it.
std::int64_t parseStart(std::span<const std::string> words);

std::vector<std::string> requestWords(const ReaderRequest& request);
/// Throws InputError.
ReaderRequest parseRequest(std::span<const std::string> words);

}  // namespace tessera
