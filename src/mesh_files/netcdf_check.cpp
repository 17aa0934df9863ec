#include "mesh_files/netcdf_check.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "files/input_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::uint64_t kHuge = std::numeric_limits<std::uint64_t>::max();

std::uint64_t times(std::uint64_t a, std::uint64_t b) {
    std::uint64_t product = 0;
    return __builtin_mul_overflow(a, b, &product) ? kHuge : product;
}

std::uint64_t plus(std::uint64_t a, std::uint64_t b) {
    return a > kHuge - b ? kHuge : a + b;
}

std::uint64_t padded(std::uint64_t bytes) {
    return plus(bytes, 3) / 4 * 4;
}

/// Walks through the head of a file, numbers in big-endian order. Throws InputError at the file's end.
class ClassicHead {
  public:
    ClassicHead(InputFile& file, char version) : file_(file), version_(version) {}

    std::uint64_t number(std::size_t bytes) {
        const std::string_view text = file_.bytesFrom(at_, bytes);
        if (text.size() < bytes) fail();
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < bytes; ++i) value = value << 8 | std::uint8_t(text[i]);
        at_ += bytes;
        return value;
    }
    std::uint64_t count() { return number(version_ == 5 ? 8 : 4); }
    std::uint64_t offset() { return number(version_ == 1 ? 4 : 8); }
    std::uint64_t noRecords() const { return version_ == 5 ? kHuge : 0xffffffffu; }

    void skip(std::uint64_t bytes) {
        if (bytes > file_.size() - at_) fail();
        at_ += std::size_t(bytes);
    }
    void skipName() { skip(padded(count())); }

    /// Entries of a list; each takes 8 bytes at least.
    std::uint64_t listLength() {
        number(4);  // what is listed
        const std::uint64_t length = count();
        if (length > (file_.size() - at_) / 8) fail();
        return length;
    }

    std::uint64_t typeBytes() {
        constexpr std::uint64_t kBytes[] = {0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8};
        const std::uint64_t type = number(4);
        if (type < 1 || type >= std::size(kBytes)) fail();
        return kBytes[type];
    }

    void skipAttributes() {
        for (std::uint64_t a = listLength(); a > 0; --a) {
            skipName();
            const std::uint64_t bytes = typeBytes();
            skip(padded(times(bytes, count())));
        }
    }

    [[noreturn]] void fail() const {
        throw InputError(file_.path() + ": damaged: its NetCDF head is wrong or cut off");
    }

  private:
    InputFile& file_;
    char version_;
    std::size_t at_ = 4;
};

/// Bytes that the variables reach to; values that pad the last one aren't counted.
std::uint64_t declaredBytes(ClassicHead& head) {
    std::uint64_t records = head.count();
    if (records == head.noRecords()) records = 0;
    std::vector<std::uint64_t> lengths(head.listLength());
    for (std::uint64_t& length : lengths) {
        head.skipName();
        length = head.count();
    }
    head.skipAttributes();
    struct RecordVariable {
        std::uint64_t begin, bytes;
    };
    std::vector<RecordVariable> recordVariables;
    std::uint64_t end = 0, recordBytes = 0;
    for (std::uint64_t variable = head.listLength(); variable > 0; --variable) {
        head.skipName();
        bool hasRecords = false;
        std::uint64_t values = 1;
        const std::uint64_t dimensions = head.count();
        for (std::uint64_t d = 0; d < dimensions; ++d) {
            const std::uint64_t dimension = head.count();
            if (dimension >= lengths.size()) head.fail();
            if (d == 0 && lengths[dimension] == 0)
                hasRecords = true;
            else
                values = times(values, lengths[dimension]);
        }
        head.skipAttributes();
        const std::uint64_t bytes = times(values, head.typeBytes());
        head.count();  // the same, padded
        const std::uint64_t begin = head.offset();
        if (hasRecords) {
            recordVariables.push_back({begin, bytes});
            recordBytes = plus(recordBytes, padded(bytes));
        } else if (bytes > 0) {
            end = std::max(end, plus(begin, bytes));
        }
    }
    if (recordVariables.size() == 1) recordBytes = recordVariables.front().bytes;  // then without padding
    if (records > 0)
        for (const RecordVariable& v : recordVariables)
            if (v.bytes > 0)
                end = std::max(end, plus(plus(v.begin, times(records - 1, recordBytes)), v.bytes));
    return end;
}

}  // namespace

void checkNetcdfSize(const std::string& path) {
    InputFile file(path);
    const std::string magic = file.copy(0, 4);
    if (magic.size() < 4 || !magic.starts_with("CDF") || (magic[3] != 1 && magic[3] != 2 && magic[3] != 5))
        return;
    ClassicHead head(file, magic[3]);
    const std::uint64_t declared = declaredBytes(head);
    if (declared > file.size())
        throw InputError(path + ": damaged or cut off: its variables take " + std::to_string(declared) +
                         " bytes, the file has " + std::to_string(file.size()));
}

}  // namespace tessera
