/* libpsabench: converter chips and boards, register by register and edge by edge, for other programs.
 * (docs/library.md is the way in, with examples; this is the manual.)
 *
 * A driver under test is linked or shimmed against a part on a simulated bench: the program moves the pins or exchanges
 * SPI bytes, lets simulated time pass, and gives the input voltages. Nothing happens between calls, and the same calls
 * give the same answers on every machine.
 *
 *     psabench *b = psabench_new(1);
 *     psabench_part *adc = psabench_part_new(b, "ads1256", "adc", "vref_v=2.5 noise_scale=0");
 *     psabench_set_volts(adc, 0, 1.0);                        // AIN0
 *     psabench_run_until_level(adc, psabench_pin(adc, "DRDY"), 0, 1000000000);
 *     psabench_set(adc, psabench_pin(adc, "CS"), 0);
 *     psabench_spi(adc, (uint8_t[]){0x01}, NULL, 1);           // RDATA
 *     psabench_run_for(b, 7000);                               // t6
 *     psabench_spi(adc, NULL, word, 3);                        // 24 bits
 *
 * Time: int64_t nanoseconds since the bench was made. It moves only in psabench_run_*(), psabench_spi() and
 * psabench_board_*(). Callbacks come from in there, from psabench_set() and from the functions that change an input; they
 * get PSABENCH_BAD_ARGUMENT from whatever would move time, make or record, and psabench_free() does nothing there. They may
 * read everything and set pins, but an input or frame callback and a watcher of a board not those of its own part. Only the
 * handler of an interrupt may do everything, but psabench_free().
 * Levels: 0 or 1, the level on the wire (DRDY and CS are active low: 0 is active).
 * Errors: functions that can fail return NULL or a negative enum psabench_error; psabench_error_text() has the reason in
 * one line: what, where, what would be right. NULL for a bench or a part is such an error. Nothing is printed, nothing
 * exits. Where the program under test errs against the part (a gap too short, a word lost, a reserved code) nothing fails:
 * the part does what it does and psabench_counter() counts it.
 * Memory: psabench_new(), psabench_part_new() and a recording allocate, nothing else does. Threads: a bench belongs to one
 * at a time; different benches share nothing. */
#ifndef PSABENCH_H
#define PSABENCH_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Programs built against one ABI number run with every library of the same number: it is that of the shared library
 * (libpsabench.so.N). Functions are added without a new number; nothing is changed or removed without one. */
#define PSABENCH_ABI 0

#if defined(__GNUC__)
#define PSABENCH_API __attribute__((visibility("default")))
#else
#define PSABENCH_API
#endif

PSABENCH_API int psabench_abi(void);             /* PSABENCH_ABI of the library that is running */
PSABENCH_API const char *psabench_version(void); /* "0.1.0" */

typedef struct psabench psabench;           /* a bench: simulated time and the parts on it */
typedef struct psabench_part psabench_part; /* a chip or a board on a bench; freed with it */

enum psabench_error {
    PSABENCH_OK = 0,
    PSABENCH_BAD_ARGUMENT =
        -1,                 /* no such pin, input, register, option; a level that is not 0 or 1; time that runs back;
                                   not allowed from a callback */
    PSABENCH_NOT_HERE = -2, /* this part has nothing of the kind: SPI of a board, frames of a chip */
    PSABENCH_REFUSED = -3,  /* a board rejects a register write: read-only, or a value its chip does not take */
    PSABENCH_TIMEOUT = -4,  /* it did not happen within the time given */
    PSABENCH_SYSTEM = -5,   /* file, memory */
    PSABENCH_DEADLINE = -6, /* psabench_deadline() is over: time stands still */
    PSABENCH_VIOLATED = -7  /* psabench_check(): the program did what the data sheet forbids */
};

/* ---- The bench ---- */

/* Every noise source draws from a stream of its own, made from the seed and the part's name. NULL: no memory. */
PSABENCH_API psabench *psabench_new(uint64_t seed);
PSABENCH_API void psabench_free(psabench *b); /* with its parts; closes the recording; NULL is allowed */
PSABENCH_API const char *psabench_error_text(const psabench *b); /* of the latest failure on this bench; "" if none */

PSABENCH_API int64_t psabench_now_ns(const psabench *b);
PSABENCH_API int64_t psabench_next_ns(const psabench *b); /* when something will happen by itself; INT64_MAX: never */
PSABENCH_API int psabench_run_until(psabench *b, int64_t t_ns); /* from psabench_now_ns() up to 2^60: 36 years */
PSABENCH_API int psabench_run_for(psabench *b, int64_t dt_ns);

/* The program under test has until t_ns; INT64_MAX: no deadline. Then time stands still: what would move it calls fn (NULL:
 * nothing) and gives PSABENCH_DEADLINE, a psabench_spi() or psabench_board_*() that has begun before is finished. So does
 * psabench_get() when it is called a million times while no time passes. fn may exit, or leave the program by longjmp() or an
 * exception: the bench is as between two calls. psabench_error_text() has the levels of the pins: what is waited for. */
typedef void psabench_deadline_fn(void *ctx, psabench *b);
PSABENCH_API int psabench_deadline(psabench *b, int64_t t_ns, psabench_deadline_fn *fn, void *ctx);

/* Records the pins of the parts that are on the bench (VCD, 1 ns, a scope named after each part) from now until
 * psabench_vcd_close(), psabench_free() or the next call. The picture of what a driver did, for GTKWave, PulseView,
 * sigrok-cli. A write that failed on the way (disk full) is reported by psabench_vcd_close(). */
PSABENCH_API int psabench_vcd(psabench *b, const char *path);
PSABENCH_API int psabench_vcd_close(psabench *b); /* PSABENCH_OK too when there is no recording */

/* ---- Parts ---- */

/* Parts: "ads1281" "ads1282" "ads1255" "ads1256" "ad7710" "ad7711" "ad7711a" "ad7712" "psa2". name: for the recording and
 * the noise streams, unique on the bench, 1 to 31 of A-Z a-z 0-9 _ - . options: "key=value key=value"; psabench_options() lists them; NULL or "": all
 * default. The part has its supplies and clock from now on; what it does after power-up begins at once.
 * NULL: psabench_error_text(b) says why. */
PSABENCH_API psabench_part *psabench_part_new(psabench *b, const char *part, const char *name, const char *options);

/* One line an option: "key=default  what it is, unit, range". NULL: no such part. psabench_parts(): their names, a space
 * between two. */
PSABENCH_API const char *psabench_options(const char *part);
PSABENCH_API const char *psabench_parts(void);

PSABENCH_API psabench *psabench_of(const psabench_part *p); /* the bench it is on */
PSABENCH_API const char *psabench_part_name(const psabench_part *p);

/* ---- Pins ---- */

/* psabench_pin_name(p, 0), 1, ... lists them up to NULL. psabench_pin(): number, or PSABENCH_BAD_ARGUMENT.
 *   ads1281, ads1282   DRDY DOUT SCLK DIN SYNC RESET PWDN MFLAG; M0 M1 MCLK (modulator output mode);
 *                      ads1281 with pin_mode=1: DR0 DR1 PHS HPF CSYNC
 *   ads1255, ads1256   DRDY DOUT SCLK DIN CS SYNC RESET D0 D1; ads1256: D2 D3. SYNC is SYNC/PDWN. D0.. are both input and
 *                      output. As CLKOUT D0 reads 0: counter clkout_hz has the frequency
 *   ad7710 .. ad7712   DRDY SDATA SCLK A0 RFS TFS MODE SYNC STANDBY. SDATA and, with MODE high, SCLK are both input and
 *                      output: what is read is the level of whoever drives
 *   psa2               the article's lines SYNC_A SClk DRD_A DIn DOutX DOutY DOutZ SYNC_T CST DRD_T DInT DOutT Res Data CLK
 *                      Int, all outputs; a 0 set on Res starts the board's own reset pulse
 * Inputs that no one has set: SCLK, DIN, the SYNC and mode pins of the ads128x and D0.. low; CS, RESET, PWDN, the SYNC of
 * the ads125x high; of the ad771x RFS, TFS, SYNC, STANDBY high. DOUT of the ads125x reads 0 in high impedance. */
PSABENCH_API int psabench_pin(const psabench_part *p, const char *name);
PSABENCH_API const char *psabench_pin_name(const psabench_part *p, int pin);
PSABENCH_API int psabench_pin_is_input(const psabench_part *p, int pin); /* of the part: the program may set it */

/* Now. Of psa2 the lines that carry bits (SClk, DIn.., DOut.., Data, CLK) are known only when their burst is over:
 * PSABENCH_NOT_HERE, watch or record them. */
PSABENCH_API int psabench_set(psabench_part *p, int pin, int level);
PSABENCH_API int psabench_get(const psabench_part *p, int pin); /* 0, 1 or an error */

/* Called at each change of an output pin, at its own instant; fn NULL: no more. One watcher a pin. A line of psa2 is reported
 * up to 0.25 ms late, with its own t_ns and in order of time with the other lines of the board. */
typedef void psabench_watch_fn(void *ctx, psabench_part *p, int pin, int level, int64_t t_ns);
PSABENCH_API int psabench_watch(psabench_part *p, int pin, psabench_watch_fn *fn, void *ctx);

/* Lets time pass until an output pin has the level, at once if it has it now; PSABENCH_TIMEOUT after timeout_ns. */
PSABENCH_API int psabench_run_until_level(psabench_part *p, int pin, int level, int64_t timeout_ns);

/* The same until the next edge of an output pin of a chip, never at once. */
enum psabench_edge { PSABENCH_FALLING = 0, PSABENCH_RISING = 1, PSABENCH_EITHER = 2 };
PSABENCH_API int psabench_run_until_edge(psabench_part *p, int pin, int edge, int64_t timeout_ns);

/* ---- Interrupts ---- */

/* An edge of a chip's output calls fn (NULL: no more), in place of the program, where time moves: between two instants of
 * psabench_run_*(), at the end of psabench_spi() and psabench_board_*(), which are not interrupted. fn may do what the program
 * may: exchange bytes, wait. What it interrupted then ends later, if need be. One at a time: an edge meanwhile waits, once a
 * pin, until the program's time moves again; parts in the order of their making first, then pins by number. */
typedef void psabench_interrupt_fn(void *ctx, psabench_part *p, int pin);
PSABENCH_API int psabench_on_interrupt(psabench_part *p, int pin, int edge, psabench_interrupt_fn *fn, void *ctx);
PSABENCH_API int psabench_mask(psabench *b, int masked); /* 1: all wait until 0. Returns what it was, or an error */

/* Lets time pass until one has been served, or, where none can be (masked, in a handler), is waiting. */
PSABENCH_API int psabench_run_until_interrupt(psabench *b, int64_t timeout_ns);

/* ---- Inputs ---- */

/* Input of a part, volts (PSA-2 with a current input: amperes), at t_ns: never earlier than the last call for the same
 * input, perhaps up to a data period ago (ADS128x). Numbers: ads1256: 0..7 AIN0..7, 8 AINCOM, to AGND; ads1255: 0, 1, 8;
 * ads1282: 0 AIN1, 1 AIN2, differential; ads1281: 0; ad7710: 0 AIN1(+), 1 AIN1(-), 2 AIN2(+), 3 AIN2(-); ad7711: 0..2, 2 AIN2;
 * ad7711a: 0, 1; ad7712: 0..2, 2 AIN2, to VBIAS; psa2: 0..2 sensors X, Y, Z, and, only for psabench_set_volts(), 3..6
 * the temperatures of sensors X, Y, Z and of the board, degC. All are 0 V at first. What is no number counts as 0. */
typedef double psabench_input_fn(void *ctx, psabench_part *p, int input, int64_t t_ns);
PSABENCH_API int psabench_set_input(psabench_part *p, psabench_input_fn *fn,
                                    void *ctx);                                 /* all inputs; NULL: constants */
PSABENCH_API int psabench_set_volts(psabench_part *p, int input, double volts); /* this one constant from now on */

/* Bits of a modulator, those of a real ADS1281 or ADS1282 for instance, in place of the model's own and of the input: what
 * the converter's filters make of them. A byte a clock of the modulator (CLK/4): PSABENCH_M0_M1: level of M0 + 2 * level of M1,
 * as on the pins; PSABENCH_ONE_BIT: 0 or 1, the bit of any other modulator. Full scale is 90 % of ones. The array is the
 * caller's and stays as it is while it plays. The converter restarts now; the first byte is the first clock that is sampled, and
 * the others go by with MCLK. After the last, zero is converted and counter bits_missing counts. bits NULL: the model again. */
enum psabench_bits { PSABENCH_ONE_BIT = 1, PSABENCH_M0_M1 = 2 };
PSABENCH_API int psabench_play_bits(psabench_part *p, const uint8_t *bits, size_t n, int kind);

/* ---- SPI bytes ---- */

/* Exchanges n bytes on SCLK, DIN and DOUT in the part's own mode (ads128x 0, ads125x 1), MSB first, at its SCLK frequency
 * (option sclk_hz, psabench_spi_clock()); psabench_set() moves CS. Time passes, eight periods a byte, and gap_ns after each
 * byte but the last. It begins and ends with SCLK low. tx NULL: zeros; rx NULL: not kept. It moves the pins as
 * psabench_set() would: both may be mixed at byte boundaries. */
PSABENCH_API int psabench_spi(psabench_part *p, const uint8_t *tx, uint8_t *rx, size_t n);
PSABENCH_API int psabench_spi_clock(psabench_part *p, uint32_t sclk_hz, int64_t gap_ns);

/* ---- Inside, for tests: no side effects ---- */

/* Register, 0..255, or an error. psa2: 256 * group + address, groups as in psabench_board_read(). */
PSABENCH_API int psabench_peek(const psabench_part *p, unsigned address);
/* Counters of what the part did, suffered and rejected: name of number i, NULL behind the last. */
PSABENCH_API const char *psabench_counter(const psabench_part *p, int i, uint64_t *value);
PSABENCH_API int64_t psabench_count(const psabench_part *p, const char *name); /* value of that counter, or an error */
/* Those that stay 0 while the program keeps to the data sheet, listed like psabench_counter(). psabench_check():
 * PSABENCH_OK if all are 0; else PSABENCH_VIOLATED, and psabench_error_text() names them. */
PSABENCH_API const char *psabench_violation(const psabench_part *p, int i, uint64_t *value);
PSABENCH_API int psabench_check(const psabench_part *p);

/* ---- Frames of a board ---- */

struct psabench_frame {
    uint32_t size; /* of this struct, set by the library: fields are only added at the end */
    uint32_t seq;
    int64_t t_sample_ns, t_int_fall_ns, t_int_rise_ns;
    int32_t code[3]; /* X, Y, Z: 24 bits, sign-extended */
    uint32_t word[4];
    uint16_t temp_code;
    uint8_t temp_channel, status;
};
typedef void psabench_frame_fn(void *ctx, psabench_part *p, const struct psabench_frame *f);
PSABENCH_API int psabench_on_frame(psabench_part *p, psabench_frame_fn *fn, void *ctx);

/* Register of a board's converter through the board's own controller, as its host would: group 0..2 X, Y, Z, 3
 * temperature. Time passes, at most timeout_ns: the set-up after power-up (psa2: 127 ms) is waited for, too. Reading returns
 * 0..255. Writing to 0, 1 or 2 goes to all three. */
PSABENCH_API int psabench_board_read(psabench_part *p, unsigned group, unsigned address, int64_t timeout_ns);
PSABENCH_API int psabench_board_write(psabench_part *p, unsigned group, unsigned address, uint8_t value,
                                      int64_t timeout_ns);

#ifdef __cplusplus
}
#endif

#include "psabench_models.h" /* what is without a bench */

#endif
