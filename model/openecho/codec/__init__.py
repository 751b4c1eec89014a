"""Lossless compression of waveforms: a record of 32-bit words for each waveform, the same in Python and in RTL.

Two modes share one container and one form of code: the threshold coding of the published codec, and prediction with
adaptive Golomb-Rice codes. Whole files of records are `openecho.formats.compressed`.

A record is a sequence of 32-bit words, the first byte of each being its highest; bit 31 is the first:

========= ======= ================================================================================================
word      bits    content
========= ======= ================================================================================================
0         31..28  version of this format, 1
0         27..24  mode: 0 threshold, 1 prediction
0         23..20  N - 1; samples have N bits, 1 to 16
0         19..16  0
0         15..0   threshold T, 0 to 2^N - 1; 0 in mode 1
1         31..16  baseline of the samples with even index (0, 2, ...), 0 to 2^N - 1
1         15..0   baseline of the samples with odd index
2 ...             payload: the samples' codes end to end, then zeros to the end of the word
last - 1  31..16  0
last - 1  15..0   M, samples in the waveform, 0 to 65535
last      31..0   checksum of the samples
========= ======= ================================================================================================

The published header has N, M and T in front. Whoever compresses a stream learns M with the last sample, so M stands
behind the payload here, with the checksum; and the baselines are new, for digitisers put their zero well above 0, and
those with two interleaved converters put it at two heights. M is at most the number of bits of the payload, so a reader
never makes room for more than a record can hold. What changes no sample goes unnoticed: another T of the same bit
length, a baseline that no sample has. A change of one bit that changes samples is an error, but for one in 2^32.

**Checksum.** A CRC of 32 bits: the remainder of the samples, N bits each, highest first, times 2^32, divided by z^32 +
z^22 + z^2 + z + 1 over the field of two elements; it starts from all ones, and is not inverted. The polynomial is
primitive (P. Alfke, Xilinx XAPP052, 1996) and has few terms, so that a sample a clock takes few gates.

**Code.** Of a value v >= 0 with a parameter k and a limit E, q = floor(v / 2^k): if q < E, q zeros, a one and the low k
bits of v; otherwise E zeros and the N bits of the sample itself, as it was digitised (an escape). Codes have at most
k + E or N + E bits, and a credit keeps the whole from growing: it starts at 32; a sample that finds less than 16 is
written as its N bits alone, without a code, and so are all behind it; every other takes the length of its code from the
credit and adds N, except that a credit of 128 or more grows no further (a code shorter than N leaves it as it is). So a
payload has at most 32 bits more than its samples.

**Mode 0, threshold.** v = (sample - baseline) mod 2^N with the baseline of its index, k = l, the bit length of T, and E
= 1: a flag bit and l or N bits. The published flag is the other way round: 0 before the l bits of a small value, 1
before the N bits of a large one. So is it here: in this mode the flag is inverted. T = 0 is l = 0: a zero costs the
flag alone. Small is v <= 2^l - 1, all that l bits can hold.

**Mode 1, prediction.** E = 16. Each sample x is predicted in two ways, of which the one that erred less lately is
taken:

- order 0: a baseline b of N + 5 bits with five behind the point, one for even and one for odd indices, that starts at
  32 * (baseline in the header) + 16. The error in half counts is w0 = 2x - floor(b / 16), taken modulo 2^(N+1) to -2^N
  ... 2^N - 1. Afterwards b grows by 1 if w0 >= 0, else it falls by 1, modulo 2^(N+5).
- order 2: the line through the last two samples; w2 = 2 (x - 2 x' + x''), modulo likewise. For sample 1, x'' = x';
  sample 0 has no such prediction.

An error w is folded to u = w if w >= 0, else -w - 1; 0 <= u < 2^N. Each order has a spread G, which starts at 3, and
after each sample (order 2 from sample 1 on) becomes floor((u + 2 floor(G / 2) + 1) / 2): about the error, in counts, of
this sample and half of what it was before. A sample takes order 2 if its G is less than that of order 0, before either
is renewed; v is its u; and k, from that G, is 0 if G < 3, else one less than its bit length.

Both choices are made from what the decoder has too, sample by sample, so neither order nor k is written down. Order 1,
the last sample itself, is left out: as a third it saves 2 and 3 % on two of the recorded files, costs up to 2 % on the
other two, and a tenth of the encoder.

**Worked examples.** N = 8, mode 0, T = 5, so l = 3, baselines 0: samples 3, 200, 5 are the codes 0 011, 1 11001000 and
0 101::

    10700005 00000000 3e428000 00000003 c3f43ae8

N = 8, mode 1, baselines 16 and 15: samples 16, 15, 17, 15, 18 have w0 of -1, -1, 2, 0, 3, so u of 0, 0, 2, 0, 3, and
the spread of order 0, before each, is 3, 1, 0, 1, 0, that of order 2 never less: k is 1, then 0, and the codes are 1 0,
1, 001, 1 and 0001::

    11700000 0010000f a6200000 00000005 155488f0
"""

from openecho.codec.batch import pack, unpack
from openecho.codec.choice import best_threshold, choose, published_threshold
from openecho.codec.form import MODES, PREDICTION, THRESHOLD, CodecError, Form
from openecho.codec.record import decode, encode

__all__ = [
    "MODES",
    "PREDICTION",
    "THRESHOLD",
    "CodecError",
    "Form",
    "best_threshold",
    "choose",
    "decode",
    "encode",
    "pack",
    "published_threshold",
    "unpack",
]
