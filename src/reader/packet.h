#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "base/large_pages.h"

namespace tessera {

/// Bytes that aren't a whole, sound packet: where and why.
class DamagedPacket : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Takes the next bytes of a packet.
using PacketSink = std::function<void(const void* bytes, std::size_t count)>;

/// Numbers and texts one behind the other, each a multiple of 8 bytes long.
class HeadWriter {
  public:
    template <class Number>
    requires std::is_arithmetic_v<Number>
    void put(Number value) {
        static_assert(sizeof(Number) == 8);
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    void put(const std::string& text);
    /// Their number, then each.
    void put(std::span<const std::string> texts);
    std::string take() { return std::move(bytes_); }

  private:
    std::string bytes_;
};

/// What a HeadWriter put, in the same order. Throws DamagedPacket.
class HeadReader {
  public:
    explicit HeadReader(std::span<const std::byte> bytes) : rest_(bytes) {}

    template <class Number>
    Number get() {
        Number value{};
        std::memcpy(&value, take(sizeof value).data(), sizeof value);
        return value;
    }
    std::string getText();
    std::vector<std::string> getTexts();
    std::int64_t getCount(std::int64_t most, const char* what);
    void expectEnd() const;

  private:
    std::span<const std::byte> take(std::size_t count);
    std::span<const std::byte> rest_;
};

/// The form in which one process hands what it has read to another of the same build: a head, and arrays.
struct Packet {
    std::string head;             ///< of a HeadWriter
    std::int64_t arrayBytes = 0;  ///< a multiple of 8
    /// Gives the arrays away piece by piece, and their memory back on the way.
    std::function<void(const PacketSink&)> writeArrays = [](const PacketSink&) {};

    std::int64_t bytes() const;
    void writeTo(const PacketSink& sink);
};

/// A packet that has come over. Throws DamagedPacket unless it is as long as it declares.
/// @param packet starts at a multiple of 8 bytes.
class ReceivedPacket {
  public:
    explicit ReceivedPacket(std::span<const std::byte> packet);

    HeadReader head() const { return HeadReader(head_); }
    std::int64_t headBytes() const { return std::int64_t(head_.size()); }
    /// The next `count` items, which lie in the packet.
    template <class Item>
    std::span<const Item> array(std::int64_t count, const char* what) {
        static_assert(std::is_trivially_copyable_v<Item> && alignof(Item) <= 8);
        if (count < 0 || std::uint64_t(count) > rest_.size() / sizeof(Item))
            throw DamagedPacket(std::string("it ends inside its ") + what);
        const std::span<const Item> items(reinterpret_cast<const Item*>(rest_.data()), std::size_t(count));
        rest_ = rest_.subspan(items.size_bytes());
        return items;
    }
    template <class Item>
    std::vector<Item> copy(std::int64_t count, const char* what) {
        const std::span<const Item> there = array<Item>(count, what);
        std::vector<Item> items;
        reserveLarge(items, there.size());
        items.assign(there.begin(), there.end());
        return items;
    }
    void expectEnd() const;

  private:
    std::span<const std::byte> head_, rest_;
};

}  // namespace tessera
