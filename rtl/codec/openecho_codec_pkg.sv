// Constants of the lossless codec; what they mean is in the format's specification, model/openecho/codec/__init__.py.
package openecho_codec_pkg;
  localparam int CODEC_VERSION = 1;
  localparam int ESCAPE_W = 4;
  localparam int ESCAPE = 1 << ESCAPE_W;  // zeros that announce a sample as it is, in prediction
  localparam int BASELINE_FRAC = 5;
  localparam int START_SPREAD = 3;
  localparam int CREDIT_W = 8;  // with its highest bit set it grows no further
  localparam int START_CREDIT = 32;  // codes are written while there are at least 2^ESCAPE_W
  localparam int COUNT_W = 17;  // up to 65,535 samples, and a bit that says that there were more
endpackage
