// root = floor(sqrt(radicand)), two bits of the radicand and one of the root a clock, as by hand.
//
// Latency ROOT_W cycles, one operation at a time; exact. A serial form suffices: it runs once a waveform.
module openecho_square_root #(
    parameter int ROOT_W = 20
) (
    input  logic                clk,
    input  logic                rst,
    input  logic                s_valid,
    output logic                s_ready,
    input  logic [2*ROOT_W-1:0] s_radicand,
    output logic                m_valid,
    input  logic                m_ready,
    output logic [  ROOT_W-1:0] m_root
);
  localparam int STEP_W = $clog2(ROOT_W + 1);

  logic busy_q;
  logic [STEP_W-1:0] step_q;
  logic [2*ROOT_W-1:0] radicand_q;  // the digits that are not used yet, at the top
  logic [ROOT_W-1:0] root_q;
  logic [ROOT_W-1:0] remainder_q;  // at most twice the root so far; one bit more only after the last step, unused
  logic [ROOT_W+1:0] shifted, rest;
  logic too_small;

  assign s_ready = !busy_q || (m_valid && m_ready);
  assign m_valid = busy_q && step_q == '0;
  assign m_root = root_q;

  assign shifted = {remainder_q, radicand_q[2*ROOT_W-1-:2]};
  assign {too_small, rest} = {1'b0, shifted} - {1'b0, root_q, 2'b01};

  always_ff @(posedge clk) begin
    if (rst) begin
      busy_q <= 1'b0;
    end else if (s_ready) begin
      busy_q <= s_valid;
    end
    if (s_ready) begin
      step_q <= STEP_W'(ROOT_W);
      radicand_q <= s_radicand;
      remainder_q <= '0;
      root_q <= '0;
    end else if (!m_valid) begin
      step_q <= step_q - 1'b1;
      radicand_q <= radicand_q << 2;
      remainder_q <= ROOT_W'(too_small ? shifted : rest);
      root_q <= {root_q[ROOT_W-2:0], !too_small};
    end
  end
endmodule
