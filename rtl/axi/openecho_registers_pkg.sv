// Registers of openecho_axi: made by scripts/registers.py from model/openecho/registers.py, not written by hand.
package openecho_registers_pkg;
  localparam int ADDRESS_W = 12;  // of bytes

  // `OECH` in ASCII
  localparam logic [ADDRESS_W-1:0] ADDRESS_ID = 12'h000;
  localparam logic [31:0] RESET_ID = 32'h4f454348;

  // of OpenEcho
  localparam logic [ADDRESS_W-1:0] ADDRESS_VERSION = 12'h004;
  localparam logic [31:0] RESET_VERSION = 32'h00000100;
  localparam int VERSION_W = 24;
  localparam int VERSION_PATCH = 0;  // patch
  localparam int VERSION_MINOR = 8;  // minor
  localparam int VERSION_MAJOR = 16;  // major

  // parameters
  localparam logic [ADDRESS_W-1:0] ADDRESS_BUILD0 = 12'h008;
  localparam int BUILD0_W = 32;
  localparam int BUILD0_SAMPLE_W = 0;  // `SAMPLE_W`
  localparam int BUILD0_EXP_W = 8;  // `EXP_W`
  localparam int BUILD0_FRAC = 16;  // `FRAC`
  localparam int BUILD0_WORD_W = 24;  // bits of a record's word, 32 or 64

  localparam logic [ADDRESS_W-1:0] ADDRESS_BUILD1 = 12'h00c;
  localparam int BUILD1_W = 17;
  localparam int BUILD1_MAX_SAMPLES = 0;  // `MAX_SAMPLES`

  localparam logic [ADDRESS_W-1:0] ADDRESS_BUILD2 = 12'h010;
  localparam int BUILD2_W = 8;
  localparam int BUILD2_TAP_COUNT = 0;  // `TAP_COUNT`

  localparam logic [ADDRESS_W-1:0] ADDRESS_CONTROL = 12'h014;
  localparam logic [31:0] RESET_CONTROL = 32'h00000000;
  localparam int CONTROL_W = 1;
  localparam int CONTROL_SOFT_RESET = 0;  // soft reset: after the waveforms that were begun; 1 until it is done

  localparam logic [ADDRESS_W-1:0] ADDRESS_STATUS = 12'h018;
  localparam logic [31:0] RESET_STATUS = 32'h00000000;
  localparam int STATUS_W = 3;
  localparam int STATUS_BUSY = 0;  // a waveform is in the core
  localparam int STATUS_CHANGE_WAITS = 1;  // a changed setting waits for the core to empty
  localparam int STATUS_RESET_WAITS = 2;  // a soft reset waits for it

  // setting `n`, 4.4 bits, at least 0x10
  localparam logic [ADDRESS_W-1:0] ADDRESS_N = 12'h020;
  localparam logic [31:0] RESET_N = 32'h00000020;

  // setting `min_interval`, as many bits as count `MAX_SAMPLES`
  localparam logic [ADDRESS_W-1:0] ADDRESS_MIN_INTERVAL = 12'h024;
  localparam logic [31:0] RESET_MIN_INTERVAL = 32'h00000005;

  // setting `min_amplitude`, `SAMPLE_W` bits
  localparam logic [ADDRESS_W-1:0] ADDRESS_MIN_AMPLITUDE = 12'h028;
  localparam logic [31:0] RESET_MIN_AMPLITUDE = 32'h00000005;

  // setting `k`, 4.4 bits
  localparam logic [ADDRESS_W-1:0] ADDRESS_K = 12'h02c;
  localparam logic [31:0] RESET_K = 32'h00000030;

  // trailers taken; stops at all ones
  localparam logic [ADDRESS_W-1:0] ADDRESS_WAVEFORMS = 12'h030;
  localparam logic [31:0] RESET_WAVEFORMS = 32'h00000000;

  // echoes taken; stops at all ones
  localparam logic [ADDRESS_W-1:0] ADDRESS_ECHOES = 12'h034;
  localparam logic [31:0] RESET_ECHOES = 32'h00000000;

  // cycles in which a sample was offered and not taken; stops at all ones
  localparam logic [ADDRESS_W-1:0] ADDRESS_STALLS = 12'h038;
  localparam logic [31:0] RESET_STALLS = 32'h00000000;

  // errors, of all causes; stops at all ones
  localparam logic [ADDRESS_W-1:0] ADDRESS_ERRORS = 12'h03c;
  localparam logic [31:0] RESET_ERRORS = 32'h00000000;

  localparam logic [ADDRESS_W-1:0] ADDRESS_IRQ_STATUS = 12'h040;
  localparam logic [31:0] RESET_IRQ_STATUS = 32'h00000000;
  localparam int IRQ_STATUS_W = 2;
  localparam int IRQ_STATUS_WAVEFORM = 0;  // a waveform's trailer was taken
  localparam int IRQ_STATUS_ERROR = 1;  // an error was counted

  // bits of IRQ_STATUS that raise `irq`
  localparam logic [ADDRESS_W-1:0] ADDRESS_IRQ_MASK = 12'h044;
  localparam logic [31:0] RESET_IRQ_MASK = 32'h00000000;
  localparam int IRQ_MASK_W = 2;
  localparam int IRQ_MASK_WAVEFORM = 0;  // a waveform's trailer was taken
  localparam int IRQ_MASK_ERROR = 1;  // an error was counted

  localparam logic [ADDRESS_W-1:0] ADDRESS_ERROR_CAUSE = 12'h048;
  localparam logic [31:0] RESET_ERROR_CAUSE = 32'h00000000;
  localparam int ERROR_CAUSE_W = 4;
  localparam int ERROR_CAUSE_TOO_SHORT = 0;  // waveform too short
  localparam int ERROR_CAUSE_TOO_LONG = 1;  // waveform too long, or a missing tlast
  localparam int ERROR_CAUSE_SAMPLE = 2;  // sample beyond full scale
  localparam int ERROR_CAUSE_SETTING = 3;  // illegal setting written
endpackage
