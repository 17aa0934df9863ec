#include "io/reader_report.h"

#include <charconv>

#include "base/error.h"

namespace tessera {

namespace {

constexpr std::size_t kFixedWords = 5;

template <class Number>
Number parseNumber(const std::string& word) {
    Number value{};
    const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
    if (word.empty() || result.ec != std::errc() || result.ptr != word.data() + word.size())
        throw InputError("the reader of meshes is started by tessera itself; '" + word + "' isn't a number");
    return value;
}

}  // namespace

std::vector<std::string> requestWords(const ReaderRequest& request) {
    static_assert(sizeof(ReadOptions) == sizeof(std::vector<std::string>) + 8,
                  "a new member of ReadOptions needs its word here and in parseRequest");
    std::vector<std::string> words{std::to_string(request.parent), std::to_string(request.memoryBytes),
                                   std::to_string(request.threads), std::to_string(request.options.timeStep),
                                   request.path};
    words.insert(words.end(), request.options.fields.begin(), request.options.fields.end());
    return words;
}

ReaderRequest parseRequest(std::span<const std::string> words) {
    if (words.size() < kFixedWords) throw InputError("the reader of meshes is started by tessera itself");
    ReaderRequest request;
    request.parent = parseNumber<std::int64_t>(words[0]);
    request.memoryBytes = parseNumber<std::int64_t>(words[1]);
    request.threads = parseNumber<int>(words[2]);
    request.options.timeStep = parseNumber<int>(words[3]);
    request.path = words[4];
    request.options.fields.assign(words.begin() + kFixedWords, words.end());
    return request;
}

}  // namespace tessera
