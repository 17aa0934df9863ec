#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "reader/isolated_reader.h"

namespace tessera {

/// How reading ended, as the reading process reports it.
enum class ReaderOutcome : std::uint32_t {
    meshInMemory,  ///< the mesh's packet is in the shared memory
    meshFollows,   ///< it follows in the pipe, where a limit on file sizes forbids the shared memory
    /// the file has a format that this program doesn't read; a message follows, also for the ones below
    otherFormat,
    inputError,
    ioError,
    internalError,
    otherError,
    overLimit,    ///< the memory limit was reached
    outOfMemory,  ///< the memory that the parent itself may use was reached
};

/// Stands before the message or the mesh in the pipe.
struct ReportStart {
    static constexpr std::uint32_t kMagic = 0x54737373;
    std::uint32_t magic = kMagic;
    ReaderOutcome outcome = ReaderOutcome::otherError;
    std::uint64_t bytes = 0;  ///< that follow
};

/// What the reading process needs to know; as words, the arguments of its program.
struct ReaderRequest {
    std::int64_t parent = 0;  ///< process that waits for the answer
    std::int64_t memoryBytes = 0;
    int threads = 0;
    std::string path;
    ReadOptions options;
};

std::vector<std::string> requestWords(const ReaderRequest& request);
/// Throws InputError.
ReaderRequest parseRequest(std::span<const std::string> words);

}  // namespace tessera
