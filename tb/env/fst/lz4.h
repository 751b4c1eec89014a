// Stands in for the header of the LZ4 library, which Verilator's FST writer needs and a bare machine lacks.
//
// The result is a valid LZ4 block that compresses nothing: one run of literals. An FST file grows by that, and the bench
// needs no library beyond those of the compiler.
#pragma once

#include <cstring>

inline int LZ4_compressBound(int size) { return size + size / 255 + 16; }

inline int LZ4_compress_default(const char* source, char* destination, int size, int) {
    char* next = destination;
    if (size < 15) {
        *next++ = static_cast<char>(size << 4);
    } else {
        *next++ = static_cast<char>(0xf0);
        int rest = size - 15;
        for (; rest >= 255; rest -= 255) *next++ = static_cast<char>(0xff);
        *next++ = static_cast<char>(rest);
    }
    std::memcpy(next, source, size);
    return static_cast<int>(next - destination) + size;
}
