#include "files/file_digest.h"

#include <bit>
#include <cstdio>
#include <cstring>

namespace tessera {
namespace {

// Every step is a bijection of the lane for a fixed word, and of the word for a fixed lane, so a changed word
// changes the result.
std::uint64_t finish(std::uint64_t x) {
    x ^= x >> 32;
    x *= 0x9fb21c651e98df25u;
    x ^= x >> 29;
    x *= 0xd1b54a32d192ed03u;
    return x ^ (x >> 32);
}

}  // namespace

void FileDigest::mixWord(std::uint64_t word) {
    lanes_[0] = std::rotl(lanes_[0] ^ word, 29) * 0x9e3779b97f4a7c15u;
    lanes_[1] = (std::rotl(lanes_[1], 41) + word) * 0xc2b2ae3d27d4eb4fu;
}

void FileDigest::update(const void* bytes, std::size_t count) {
    const unsigned char* next = static_cast<const unsigned char*>(bytes);
    const unsigned char* end = next + count;
    while (next != end && (length_ & 7) != 0) {
        pending_ |= std::uint64_t(*next++) << (8 * (length_ & 7));
        if ((++length_ & 7) == 0) {
            mixWord(pending_);
            pending_ = 0;
        }
    }
    for (; end - next >= 8; next += 8, length_ += 8) {
        std::uint64_t word;
        std::memcpy(&word, next, 8);
        mixWord(word);
    }
    for (; next != end; ++length_) pending_ |= std::uint64_t(*next++) << (8 * (length_ & 7));
}

std::string FileDigest::uuid() {
    mixWord(pending_);
    mixWord(length_);
    const std::uint64_t high = finish(lanes_[0] + std::rotl(lanes_[1], 17));
    const std::uint64_t low = finish(lanes_[1] ^ std::rotl(lanes_[0], 23));
    // RFC 9562: the version nibble is 8, the variant bits are 10; the other 122 bits are free.
    std::array<char, 37> text{};
    std::snprintf(text.data(), text.size(), "%08x-%04x-8%03x-%04x-%012llx", unsigned(high >> 32),
                  unsigned(high >> 16) & 0xffffu, unsigned(high) & 0xfffu,
                  (unsigned(low >> 48) & 0x3fffu) | 0x8000u,
                  static_cast<unsigned long long>(low & 0xffffffffffffu));
    return text.data();
}

bool isDigestUuid(const std::string& uuid) {
    return uuid.size() == 36 && uuid[14] == '8' &&
           (uuid[19] == '8' || uuid[19] == '9' || uuid[19] == 'a' || uuid[19] == 'b');
}

}  // namespace tessera
