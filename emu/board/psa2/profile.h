/* What is soldered, programmed or assumed on a PSA-2 (or PSA-1) board: one plain struct per board profile.
 *
 * Filled by emu/scenario/profile.c from proto/profiles/NAME.yaml through the field table below (board/field.h), and checked by
 * psa2_profile_check() before a board may use it. Everything the article leaves open is here (design: open questions),
 * each with its evidence grade in docs/boards/psa2.md. Pure. */
#ifndef PSABENCH_BOARD_PSA2_PROFILE_H
#define PSABENCH_BOARD_PSA2_PROFILE_H

#include "board/field.h"

#include <stdint.h>

#define PSA2_WORDS          4u
#define PSA2_DELAYS         3u /* of Int, Data, CLK */
#define PSA2_AXES           3u
#define PSA2_ANALOG_MAX_V   5.25 /* AVDD - AVSS */
#define PSA2_SETUP_MAX      16u
#define PSA2_INT_LOW_MIN_NS 74000  /* article, protocol of exchange: "not less than 74 us" */
#define PSA2_CLOCK_PPM      100    /* E0: by which a clock may be fast; 74.000 us are nominal */
#define PSA2_GAP_CLK        4u     /* article: pause between words, CLK periods */
#define PSA2_WORD_NS_MAX    150000 /* edges of a word are reported when it ends: inside TRACE_LAG_NS */

enum psa2_word { PSA2_WORD_X, PSA2_WORD_Y, PSA2_WORD_Z, PSA2_WORD_T };
enum psa2_setup_event { PSA2_ON_DRD_A, PSA2_ON_DRD_T };
enum psa2_setup_action { PSA2_WRITE_A, PSA2_WRITE_T, PSA2_SYNC_A, PSA2_SYNC_T };

/* One transfer of the set-up: it waits for its data-ready event, then is carried out. */
struct psa2_setup_step {
    enum psa2_setup_event on;
    enum psa2_setup_action action;
    uint8_t bytes[8]; /* in transmit order, MSB first */
    uint8_t count;
};

struct psa2_profile {
    char name[32];
    /* clocks */
    uint32_t fclk_hz;           /* crystal GOCh, clock of the accelerometer converters */
    uint32_t temp_clkin_hz;     /* clock of the temperature converter */
    uint32_t sclk_hz;           /* SClk of both serial ports */
    uint32_t line_hz, line_div; /* output CLK = line_hz / line_div */
    /* output frame */
    unsigned word_bits;              /* 16, 24 or 32 */
    unsigned lead_in_clk;            /* CLK periods from INT fall to the first bit */
    enum psa2_word word[PSA2_WORDS]; /* order of sending, lowest address first */
    unsigned code_bits;              /* significant bits of a code in its word: 16, 24 or 32 */
    /* end elements of the line: from the driver's input to the receiver's output */
    double line_delay_ns[PSA2_DELAYS];
    double line_skew_ns[PSA2_DELAYS]; /* by which falls are later than rises */
    /* reading */
    unsigned read_bits;     /* SClk pulses of one accelerometer read: 24 (article) or 32 */
    bool gate_sclk;         /* SClk reaches only the group addressed; false shows the hazard of a part without CS */
    unsigned temp_channels; /* 1..8 single-ended inputs scanned in turn; 0: none */
    /* converters */
    bool adc_is_1281;
    double adc_vref_v;
    double common_mode_v[PSA2_AXES]; /* of the inputs X, Y, Z over ground; 0: their range is not looked at */
    double adc_avss_v, adc_avdd_v;   /* analog supplies of the converters, by the secondary supply IVN */
    double uref_ppm_per_pct, uref_dropout_ratio; /* what the unit's supply does to UREF, which IVN makes */
    unsigned adc_pga; /* 1..64: written to CONFIG1 of an ADS1282 after the article's set-up; 1: not written */
    double temp_vref_v;
    /* temperature sensors: a current proportional to absolute temperature on a load RTD */
    double temp_sensor_a_per_k, temp_load_ohm;
    /* set-up after Res */
    struct psa2_setup_step setup[PSA2_SETUP_MAX];
    unsigned setup_count;
};

/* Elements: of word "X" ... "T", of setup "DRD_A write_A 41 00 56", "DRD_T sync_T". The default is "article". */
extern const struct fields psa2_fields;

/* CLK periods of INT low: lead-in + words + gaps. */
unsigned psa2_frame_clks(const struct psa2_profile *p);

/* INT low in ns, exact clock, rounded down. */
int64_t psa2_int_low_ns(const struct psa2_profile *p);

/* Data period of the accelerometer converters, ns, by the last CONFIG0 the set-up writes (reset value: 1000 SPS). */
int64_t psa2_profile_period_ns(const void *profile);

/* True if a board can run it; else a sentence in why (what, where, what would be right, with the arithmetic). */
bool psa2_profile_check(const void *profile, char *why, size_t cap);

#endif
