#include "reader/packet.h"

namespace tessera {

namespace {

constexpr std::uint64_t kMagic = 0x32746b6370737354;  // "Tsspckt2"

/// Stands at the start of every packet.
struct PacketStart {
    std::uint64_t magic = kMagic;
    std::uint64_t packetBytes = 0;
    std::uint64_t headBytes = 0;  ///< of the head that follows, a multiple of 8; the arrays stand behind it
};

}  // namespace

void HeadWriter::put(const std::string& text) {
    put(std::uint64_t(text.size()));
    bytes_ += text;
    bytes_.append((8 - text.size() % 8) % 8, '\0');
}

void HeadWriter::put(std::span<const std::string> texts) {
    put(std::int64_t(texts.size()));
    for (const std::string& text : texts) put(text);
}

std::span<const std::byte> HeadReader::take(std::size_t count) {
    if (count > rest_.size()) throw DamagedPacket("the head ends early");
    const auto bytes = rest_.first(count);
    rest_ = rest_.subspan(count);
    return bytes;
}

std::string HeadReader::getText() {
    const auto length = get<std::uint64_t>();
    if (length > rest_.size()) throw DamagedPacket("a text is longer than the head");
    const auto bytes = take((length + 7) / 8 * 8);
    return {reinterpret_cast<const char*>(bytes.data()), length};
}

std::vector<std::string> HeadReader::getTexts() {
    std::vector<std::string> texts;
    for (std::int64_t left = getCount(std::int64_t(rest_.size()), "texts"); left > 0; --left)
        texts.push_back(getText());
    return texts;
}

std::int64_t HeadReader::getCount(std::int64_t most, const char* what) {
    const auto count = get<std::int64_t>();
    if (count < 0 || count > most) throw DamagedPacket("it has " + std::to_string(count) + " " + what);
    return count;
}

void HeadReader::expectEnd() const {
    if (!rest_.empty()) throw DamagedPacket("the head has more bytes than it needs");
}

std::int64_t Packet::bytes() const {
    return std::int64_t(sizeof(PacketStart) + head.size()) + arrayBytes;
}

void Packet::writeTo(const PacketSink& sink) {
    const PacketStart start{kMagic, std::uint64_t(bytes()), head.size()};
    sink(&start, sizeof start);
    sink(head.data(), head.size());
    writeArrays(sink);
}

ReceivedPacket::ReceivedPacket(std::span<const std::byte> packet) {
    PacketStart start;
    if (packet.size() < sizeof start) throw DamagedPacket("it is too short");
    std::memcpy(&start, packet.data(), sizeof start);
    if (start.magic != kMagic) throw DamagedPacket("it doesn't begin as a packet does");
    if (start.packetBytes != packet.size())
        throw DamagedPacket("it has " + std::to_string(packet.size()) + " bytes, not the " +
                            std::to_string(start.packetBytes) + " that it declares");
    rest_ = packet.subspan(sizeof start);
    if (start.headBytes > rest_.size() || start.headBytes % 8 != 0)
        throw DamagedPacket("its head has no such size");
    head_ = rest_.first(start.headBytes);
    rest_ = rest_.subspan(start.headBytes);
}

void ReceivedPacket::expectEnd() const {
    if (!rest_.empty()) throw DamagedPacket("bytes are left over");
}

}  // namespace tessera
