// Stands in for the header of zlib, which Verilator's FST writer needs and a bare machine lacks; see lz4.h.
//
// The result is a valid zlib stream of stored blocks.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>

using Bytef = unsigned char;
using uLong = unsigned long;
using uLongf = unsigned long;
constexpr int Z_OK = 0;

inline uLong compressBound(uLong size) { return size + 5 * (size / 0xffff + 1) + 6; }

inline int compress2(Bytef* destination, uLongf* capacity, const Bytef* source, uLong size, int) {
    Bytef* next = destination;
    *next++ = 0x78;
    *next++ = 0x01;
    uLong begin = 0;
    do {
        const uLong length = std::min<uLong>(size - begin, 0xffff);
        *next++ = begin + length == size;
        for (const uLong field : {length, ~length}) {
            *next++ = static_cast<Bytef>(field);
            *next++ = static_cast<Bytef>(field >> 8);
        }
        std::memcpy(next, source + begin, length);
        next += length;
        begin += length;
    } while (begin < size);
    std::uint32_t low = 1, high = 0;  // Adler-32 closes the stream
    for (uLong i = 0; i < size; ++i) {
        low = (low + source[i]) % 65521;
        high = (high + low) % 65521;
    }
    for (int shift = 24; shift >= 0; shift -= 8) *next++ = static_cast<Bytef>((high << 16 | low) >> shift);
    *capacity = static_cast<uLongf>(next - destination);
    return Z_OK;
}
