// Takes an IEEE-754 word {sign, exponent, fraction} apart and classifies it. Combinational.
//
// A finite number is (-1)^sign * significand * 2^(exponent - bias - FRAC_W) with bias = 2^(EXP_W-1) - 1, subnormal or
// not: subnormals have the smallest exponent, 1, and no leading one in the significand. A NaN is signalling when the
// top bit of its fraction is zero.
module openecho_float_unpack #(
    parameter int EXP_W  = 11,
    parameter int FRAC_W = 52
) (
    input  logic [EXP_W+FRAC_W:0] word,
    output logic                  sign,
    output logic [     EXP_W-1:0] exponent,
    output logic [      FRAC_W:0] significand,
    output logic                  zero,
    output logic                  infinite,
    output logic                  nan,
    output logic                  signalling
);
  logic [ EXP_W-1:0] field;
  logic [FRAC_W-1:0] fraction;
  logic normal, special, empty;

  assign {sign, field, fraction} = word;
  assign normal = field != '0;
  assign special = field == '1;
  assign empty = fraction == '0;

  assign exponent = normal ? field : EXP_W'(1);
  assign significand = {normal, fraction};
  assign zero = !normal && empty;
  assign infinite = special && empty;
  assign nan = special && !empty;
  assign signalling = nan && !fraction[FRAC_W-1];
endmodule
