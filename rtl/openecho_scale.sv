// total = value * FACTOR, exact: a sum of shifted values, one for each digit of the factor's canonical signed form. No
// overflow where TOTAL_W holds the product; no rounding.
//
// The digits of 3 * FACTOR that differ from those of FACTOR are the non-zero ones of twice that form; one is negative
// where FACTOR has a 1. A function would do, but a simulator would go through all digits at every clock.
module openecho_scale #(
    parameter int VALUE_W = 12,
    parameter int TOTAL_W = 19,
    parameter int FACTOR  = 1
) (
    input  logic signed [VALUE_W-1:0] value,
    output logic signed [TOTAL_W-1:0] total
);
  localparam int DIGITS = (FACTOR + 2 * FACTOR) ^ FACTOR;
  localparam int PLACES = 31;  // of an int, the digits of twice the form leave so many

  for (genvar d = 0; d < PLACES; d++) begin : g_place
    logic signed [TOTAL_W-1:0] below, sum;
    if (d == 0) begin : g_lowest
      assign below = '0;
    end else begin : g_higher
      assign below = g_place[d-1].sum;
    end
    if (!DIGITS[d+1]) begin : g_nothing
      assign sum = below;
    end else if (FACTOR[d+1]) begin : g_minus
      assign sum = below - (TOTAL_W'(value) <<< d);
    end else begin : g_plus
      assign sum = below + (TOTAL_W'(value) <<< d);
    end
  end

  assign total = g_place[PLACES-1].sum;
endmodule
