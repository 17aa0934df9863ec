#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

namespace tessera {

/// A vector whose elements stay where they are in memory as it grows, and are reached in two steps of which
/// the first is mostly in the cache: its parts are large, unlike those of std::deque.
template <class T>
class SteadyVector {
  public:
    std::size_t size() const { return size_; }
    T& operator[](std::size_t i) { return (*parts_[i / kPart])[i % kPart]; }
    const T& operator[](std::size_t i) const { return (*parts_[i / kPart])[i % kPart]; }
    /// New elements have their initial values.
    void grow(std::size_t size) {
        for (; parts_.size() * kPart < size; parts_.push_back(std::make_unique<Part>())) {
        }
        size_ = size;
    }
    T& add() {
        grow(size_ + 1);
        return (*this)[size_ - 1];
    }

  private:
    static constexpr std::size_t kPart = 4096;
    using Part = std::array<T, kPart>;
    std::vector<std::unique_ptr<Part>> parts_;
    std::size_t size_ = 0;
};

}  // namespace tessera
