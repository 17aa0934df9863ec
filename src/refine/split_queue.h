#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <vector>

namespace tessera {

/// Numbers by a positive value, the largest first; of values that differ by less than a sixteenth, the one
/// that came first. A call takes the same few nanoseconds however many there are.
class SplitQueue {
  public:
    bool empty() const { return filled_ == 0; }

    void push(double value, std::uint32_t number) {
        const unsigned bucket = bucketOf(value);
        entries_.push_back({number, kNone});
        const auto at = std::uint32_t(entries_.size() - 1);
        if (first_[bucket] == kNone) {
            first_[bucket] = at;
            word_[bucket / 64] |= std::uint64_t(1) << bucket % 64;
            filled_ |= std::uint32_t(1) << bucket / 64;
        } else {
            entries_[last_[bucket]].next = at;
        }
        last_[bucket] = at;
    }

    std::optional<std::uint32_t> pop() {
        if (empty()) return {};
        const auto word = unsigned(std::bit_width(filled_) - 1);
        const auto bit = unsigned(std::bit_width(word_[word]) - 1);
        const unsigned bucket = 64 * word + bit;
        const Entry entry = entries_[first_[bucket]];
        first_[bucket] = entry.next;
        if (entry.next == kNone && (word_[word] &= ~(std::uint64_t(1) << bit)) == 0)
            filled_ &= ~(std::uint32_t(1) << word);
        if (empty()) entries_.clear();
        return entry.number;
    }

  private:
    static constexpr std::uint32_t kNone = ~std::uint32_t(0);
    static constexpr int kSteps = 16, kLeast = -64, kMost = 63;  // of an octave; exponents
    static constexpr unsigned kBuckets = unsigned(kMost - kLeast + 1) * kSteps;
    struct Entry {
        std::uint32_t number, next;
    };

    // Octave by octave, each in steps of a sixteenth of its lower end: the exponent and the first bits after
    // it.
    static unsigned bucketOf(double value) {
        const double within = std::clamp(value, 0x1p-65, 0x1.ffp62);
        return unsigned(std::bit_cast<std::uint64_t>(within) >> 48) - (1023u + kLeast - 1) * kSteps;
    }

    std::vector<Entry> entries_;
    std::array<std::uint32_t, kBuckets> first_ = filledWith(kNone), last_ = filledWith(kNone);
    std::array<std::uint64_t, kBuckets / 64> word_{};  // a bit for each bucket that isn't empty
    std::uint32_t filled_ = 0;                         // likewise, for each word
    static_assert(kBuckets / 64 == 32);

    static std::array<std::uint32_t, kBuckets> filledWith(std::uint32_t value) {
        std::array<std::uint32_t, kBuckets> all{};
        all.fill(value);
        return all;
    }
};

}  // namespace tessera
