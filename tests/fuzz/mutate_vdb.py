"""Damages .vdb files and logs of bricks: single bytes, runs of bytes, and sizes; half of the .vdb files get a digest that fits again."""

import random
import struct

UUID_AT, UUID_BYTES = 21, 36
WORD = (1 << 64) - 1
SIZES = [0, 1, -1, 1 << 31, (1 << 31) - 1, 1 << 40, (1 << 63) - 1, -(1 << 63), 0x7FFFFFF0]
SMALL_SIZES = [size for size in SIZES if -(1 << 31) <= size < 1 << 31]


def rotated(word, bits):
    return (word << bits | word >> (64 - bits)) & WORD


def finished(x):
    x ^= x >> 32
    x = x * 0x9FB21C651E98DF25 & WORD
    x ^= x >> 29
    x = x * 0xD1B54A32D192ED03 & WORD
    return x ^ x >> 32


def digest(data):
    """FileDigest::uuid of src/files/file_digest.cpp."""
    padded = data + bytes(8 - len(data) % 8) + struct.pack("<Q", len(data))
    a, b = 0x6A09E667F3BCC909, 0xBB67AE8584CAA73B
    for (word,) in struct.iter_unpack("<Q", padded):
        a = rotated(a ^ word, 29) * 0x9E3779B97F4A7C15 & WORD
        b = (rotated(b, 41) + word) * 0xC2B2AE3D27D4EB4F & WORD
    high, low = finished((a + rotated(b, 17)) & WORD), finished(b ^ rotated(a, 23))
    return f"{high >> 32:08x}-{high >> 16 & 0xFFFF:04x}-8{high & 0xFFF:03x}-{low >> 48 & 0x3FFF | 0x8000:04x}-{low & (1 << 48) - 1:012x}".encode()


def with_digest(data):
    start, end = UUID_AT, UUID_AT + UUID_BYTES
    return data[:start] + digest(data[:start] + b"0" * UUID_BYTES + data[end:]) + data[end:]


def with_digests_of_log(data):
    """The same of each record of a log of bricks (src/cache/brick_log.h), as far as it has them."""
    at = data.find(b"\n", data.find(b"\n") + 1) + 1
    while at > 0 and at + 24 <= len(data):
        packed = struct.unpack_from("<i", data, at + 20)[0]
        end = at + 24 + packed
        if packed <= 0 or end + UUID_BYTES > len(data):
            break
        data = data[:end] + digest(data[at:end]) + data[end + UUID_BYTES :]
        at = end + UUID_BYTES
    return data


def put(data, at, piece):
    data[at : at + len(piece)] = piece[: len(data) - at]


def mutant(sound, seed, index):
    """A damaged copy, and words that say how it came about."""
    rng = random.Random(f"{seed}:{index}:vdb")
    data = bytearray(sound)
    first = UUID_AT + UUID_BYTES
    if rng.random() < 0.1:
        how = "size"
        for _ in range(rng.choice([1, 1, 2])):
            at = rng.randrange(first, len(data))
            put(data, at, struct.pack("<q", rng.choice(SIZES)) if rng.random() < 0.5 else struct.pack("<i", rng.choice(SMALL_SIZES)))
    elif rng.random() < 0.2:
        how = "run"
        put(data, rng.randrange(first, len(data)), rng.randbytes(rng.choice([4, 16, 64])))
    elif rng.random() < 0.1:
        how = "cut"
        del data[rng.randrange(first, len(data)) :]
    else:
        how = "bytes"
        for _ in range(rng.choice([1, 1, 2, 8])):
            data[rng.randrange(first, len(data))] = rng.randrange(256)
    if rng.random() < 0.5:
        mend = with_digests_of_log if sound.startswith(b"tessera brick log") else with_digest
        return mend(bytes(data)), how + ", digest mended"
    return bytes(data), how
