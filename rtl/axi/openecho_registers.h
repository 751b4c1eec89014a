/* Registers of openecho_axi: made by scripts/registers.py from model/openecho/registers.py, not written by hand. */
#ifndef OPENECHO_REGISTERS_H
#define OPENECHO_REGISTERS_H

/* read; `OECH` in ASCII */
#define OPENECHO_ID_OFFSET 0x00u
#define OPENECHO_ID_RESET 0x4f454348u

/* read; of OpenEcho */
#define OPENECHO_VERSION_OFFSET 0x04u
#define OPENECHO_VERSION_RESET 0x00000100u
#define OPENECHO_VERSION_PATCH_SHIFT 0u /* patch */
#define OPENECHO_VERSION_PATCH_MASK 0x000000ffu
#define OPENECHO_VERSION_MINOR_SHIFT 8u /* minor */
#define OPENECHO_VERSION_MINOR_MASK 0x0000ff00u
#define OPENECHO_VERSION_MAJOR_SHIFT 16u /* major */
#define OPENECHO_VERSION_MAJOR_MASK 0x00ff0000u

/* read; parameters */
#define OPENECHO_BUILD0_OFFSET 0x08u
#define OPENECHO_BUILD0_SAMPLE_W_SHIFT 0u /* `SAMPLE_W` */
#define OPENECHO_BUILD0_SAMPLE_W_MASK 0x000000ffu
#define OPENECHO_BUILD0_EXP_W_SHIFT 8u /* `EXP_W` */
#define OPENECHO_BUILD0_EXP_W_MASK 0x0000ff00u
#define OPENECHO_BUILD0_FRAC_SHIFT 16u /* `FRAC` */
#define OPENECHO_BUILD0_FRAC_MASK 0x00ff0000u
#define OPENECHO_BUILD0_WORD_W_SHIFT 24u /* bits of a record's word, 32 or 64 */
#define OPENECHO_BUILD0_WORD_W_MASK 0xff000000u

/* read */
#define OPENECHO_BUILD1_OFFSET 0x0cu
#define OPENECHO_BUILD1_MAX_SAMPLES_SHIFT 0u /* `MAX_SAMPLES` */
#define OPENECHO_BUILD1_MAX_SAMPLES_MASK 0x0001ffffu

/* read */
#define OPENECHO_BUILD2_OFFSET 0x10u
#define OPENECHO_BUILD2_TAP_COUNT_SHIFT 0u /* `TAP_COUNT` */
#define OPENECHO_BUILD2_TAP_COUNT_MASK 0x000000ffu

/* read, write 1 to start */
#define OPENECHO_CONTROL_OFFSET 0x14u
#define OPENECHO_CONTROL_RESET 0x00000000u
#define OPENECHO_CONTROL_SOFT_RESET_SHIFT 0u /* soft reset: after the waveforms that were begun; 1 until it is done */
#define OPENECHO_CONTROL_SOFT_RESET_MASK 0x00000001u

/* read */
#define OPENECHO_STATUS_OFFSET 0x18u
#define OPENECHO_STATUS_RESET 0x00000000u
#define OPENECHO_STATUS_BUSY_SHIFT 0u /* a waveform is in the core */
#define OPENECHO_STATUS_BUSY_MASK 0x00000001u
#define OPENECHO_STATUS_CHANGE_WAITS_SHIFT 1u /* a changed setting waits for the core to empty */
#define OPENECHO_STATUS_CHANGE_WAITS_MASK 0x00000002u
#define OPENECHO_STATUS_RESET_WAITS_SHIFT 2u /* a soft reset waits for it */
#define OPENECHO_STATUS_RESET_WAITS_MASK 0x00000004u

/* read, write; setting `n`, 4.4 bits, at least 0x10 */
#define OPENECHO_N_OFFSET 0x20u
#define OPENECHO_N_RESET 0x00000020u

/* read, write; setting `min_interval`, as many bits as count `MAX_SAMPLES` */
#define OPENECHO_MIN_INTERVAL_OFFSET 0x24u
#define OPENECHO_MIN_INTERVAL_RESET 0x00000005u

/* read, write; setting `min_amplitude`, `SAMPLE_W` bits */
#define OPENECHO_MIN_AMPLITUDE_OFFSET 0x28u
#define OPENECHO_MIN_AMPLITUDE_RESET 0x00000005u

/* read, write; setting `k`, 4.4 bits */
#define OPENECHO_K_OFFSET 0x2cu
#define OPENECHO_K_RESET 0x00000030u

/* read; trailers taken; stops at all ones */
#define OPENECHO_WAVEFORMS_OFFSET 0x30u
#define OPENECHO_WAVEFORMS_RESET 0x00000000u

/* read; echoes taken; stops at all ones */
#define OPENECHO_ECHOES_OFFSET 0x34u
#define OPENECHO_ECHOES_RESET 0x00000000u

/* read; cycles in which a sample was offered and not taken; stops at all ones */
#define OPENECHO_STALLS_OFFSET 0x38u
#define OPENECHO_STALLS_RESET 0x00000000u

/* read; errors, of all causes; stops at all ones */
#define OPENECHO_ERRORS_OFFSET 0x3cu
#define OPENECHO_ERRORS_RESET 0x00000000u

/* read, write 1 to clear */
#define OPENECHO_IRQ_STATUS_OFFSET 0x40u
#define OPENECHO_IRQ_STATUS_RESET 0x00000000u
#define OPENECHO_IRQ_STATUS_WAVEFORM_SHIFT 0u /* a waveform's trailer was taken */
#define OPENECHO_IRQ_STATUS_WAVEFORM_MASK 0x00000001u
#define OPENECHO_IRQ_STATUS_ERROR_SHIFT 1u /* an error was counted */
#define OPENECHO_IRQ_STATUS_ERROR_MASK 0x00000002u

/* read, write; bits of IRQ_STATUS that raise `irq` */
#define OPENECHO_IRQ_MASK_OFFSET 0x44u
#define OPENECHO_IRQ_MASK_RESET 0x00000000u
#define OPENECHO_IRQ_MASK_WAVEFORM_SHIFT 0u /* a waveform's trailer was taken */
#define OPENECHO_IRQ_MASK_WAVEFORM_MASK 0x00000001u
#define OPENECHO_IRQ_MASK_ERROR_SHIFT 1u /* an error was counted */
#define OPENECHO_IRQ_MASK_ERROR_MASK 0x00000002u

/* read, write 1 to clear */
#define OPENECHO_ERROR_CAUSE_OFFSET 0x48u
#define OPENECHO_ERROR_CAUSE_RESET 0x00000000u
#define OPENECHO_ERROR_CAUSE_TOO_SHORT_SHIFT 0u /* waveform too short */
#define OPENECHO_ERROR_CAUSE_TOO_SHORT_MASK 0x00000001u
#define OPENECHO_ERROR_CAUSE_TOO_LONG_SHIFT 1u /* waveform too long, or a missing tlast */
#define OPENECHO_ERROR_CAUSE_TOO_LONG_MASK 0x00000002u
#define OPENECHO_ERROR_CAUSE_SAMPLE_SHIFT 2u /* sample beyond full scale */
#define OPENECHO_ERROR_CAUSE_SAMPLE_MASK 0x00000004u
#define OPENECHO_ERROR_CAUSE_SETTING_SHIFT 3u /* illegal setting written */
#define OPENECHO_ERROR_CAUSE_SETTING_MASK 0x00000008u

#endif
