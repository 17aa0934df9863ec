#include "reader/reader_report.h"

#include <algorithm>
#include <charconv>

#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kFixedWords = 11;
// The other program may be of another build: what they say to each other has a number, to be raised with each
// change.
constexpr const char* kProtocol = TESSERA_VERSION "/6";
constexpr const char* kByItself = "the reader of meshes is started by tessera itself";

template <class Number>
Number parseNumber(const std::string& word) {
    Number value{};
    const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (word.empty() || result.ec != std::errc() || result.ptr != word.data() + word.size())
        throw InputError(std::string(kByItself) + "; '" + word + "' isn't a number");
    return value;
}

}  // namespace

std::vector<std::string> startWords(std::int64_t parent) {
    return {kProtocol, std::to_string(parent)};
}

std::int64_t parseStart(std::span<const std::string> words) {
    if (words.size() != 2 || words[0] != kProtocol)
        throw InputError(std::string(kByItself) + ", of the same version");
    return parseNumber<std::int64_t>(words[1]);
}

std::vector<std::string> requestWords(const ReaderRequest& request) {
    static_assert(sizeof(ReadOptions) == 2 * sizeof(std::vector<std::string>) + sizeof(std::string) + 16,
                  "a new member of ReadOptions needs its word here and in parseRequest");
    std::vector<std::string> words{kProtocol,
                                   std::to_string(request.parent),
                                   std::to_string(request.memoryBytes),
                                   std::to_string(request.threads),
                                   std::to_string(request.options.timeStep),
                                   std::to_string(request.options.otherParts.size()),
                                   request.path,
                                   request.task,
                                   request.body,
                                   request.options.namedBy,
                                   std::to_string(int(request.options.followsLinks))};
    words.insert(words.end(), request.options.otherParts.begin(), request.options.otherParts.end());
    words.insert(words.end(), request.options.fields.begin(), request.options.fields.end());
    return words;
}

ReaderRequest parseRequest(std::span<const std::string> words) {
    if (words.size() < kFixedWords || words[0] != kProtocol)
        throw InputError(std::string(kByItself) + ", of the same version");
    ReaderRequest request;
    request.parent = parseNumber<std::int64_t>(words[1]);
    request.memoryBytes = parseNumber<std::int64_t>(words[2]);
    request.threads = parseNumber<int>(words[3]);
    request.options.timeStep = parseNumber<int>(words[4]);
    const auto parts = parseNumber<std::size_t>(words[5]);
    request.path = words[6];
    request.task = words[7];
    request.body = words[8];
    request.options.namedBy = words[9];
    request.options.followsLinks = parseNumber<int>(words[10]) != 0;
    const std::span<const std::string> rest = words.subspan(kFixedWords);
    if (parts > rest.size()) throw InputError(std::string(kByItself) + "; a part has no name");
    request.options.otherParts.assign(rest.begin(), rest.begin() + std::ptrdiff_t(parts));
    request.options.fields.assign(rest.begin() + std::ptrdiff_t(parts), rest.end());
    return request;
}

}  // namespace tessera
