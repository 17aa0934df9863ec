#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

namespace tessera {

/// A digest of a byte stream, to notice damage (not tampering): a change is missed with a chance of about
/// 2^-122.
class FileDigest {
  public:
    /// Pieces may have any size; only the whole stream matters.
    void update(const void* bytes, std::size_t count);
    /// As an RFC 9562 UUID of version 8 (36 characters). Ends the stream.
    std::string uuid();

  private:
    void mixWord(std::uint64_t word);
    std::array<std::uint64_t, 2> lanes_{0x6a09e667f3bcc909u, 0xbb67ae8584caa73bu};
    std::uint64_t pending_ = 0;  // bytes of an unfinished word, lowest first
    std::uint64_t length_ = 0;
};

/// Whether a UUID's text has the version that FileDigest writes.
bool isDigestUuid(const std::string& uuid);

}  // namespace tessera
