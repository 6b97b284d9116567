/* What the files of libpsabench share: bench, part, and the tables that make a part of a device. Not for others.
 *
 * A kind of part is one const row of tables: options, pins, counters, and a handful of functions. Nothing else in here
 * knows a chip. Outputs are compared with what was last told after every stimulus and every instant at which something
 * happened; only the pins that somebody watches or records. */
#ifndef PSABENCH_API_API_H
#define PSABENCH_API_API_H

#include "api/psabench.h"
#include "base/rng.h"
#include "base/sched.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { API_PINS_MAX = 32, API_INPUTS_MAX = 9, API_NAME = 32, API_ERROR = 400, API_WHY = 300 };

#define API_NO_PIN      255u
#define API_TIME_MAX_NS (INT64_C(1) << 60) /* 36 years */
#define API_STEP_NS     50000
#define API_VOLTS_MAX   1e6

enum api_dir { API_IN, API_OUT, API_BOTH };

/* A pin: name as in the data sheet. get may be NULL: of an input the level last set; of an output that is only known
 * afterwards (bursts of a board, which its trace reports) nothing but the trace. */
struct api_pin {
    const char *name;
    enum api_dir dir;
    bool idle; /* level of an input before anybody sets it */
    void (*set)(struct psabench_part *p, unsigned arg, bool level, int64_t t_ns);
    bool (*get)(const struct psabench_part *p, unsigned arg);
    unsigned arg;
};

enum api_option_type { API_REAL, API_UINT, API_BOOL, API_CHOICE };

struct api_option {
    const char *key;
    enum api_option_type type;
    size_t offset; /* in the part's struct: double, uint32_t, bool, unsigned */
    const char *standard;
    double min, max;
    const char *choices; /* words, '|' between two; the number is the place in the list */
};

/* One line of a table of options and of the text that psabench_options() gives: both come from the same list. */
#define API_OPTION_ROW(key, type, part, member, standard, min, max, choices, what)                                     \
    {key, type, offsetof(struct part, member), standard, min, max, choices},
#define API_OPTION_TEXT(key, type, part, member, standard, min, max, choices, what)                                    \
    key "=" standard "  " what API_RANGE_##type(min, max, choices) "\n"
#define API_RANGE_API_REAL(min, max, choices)   ", " #min " to " #max
#define API_RANGE_API_UINT(min, max, choices)   ", " #min " to " #max
#define API_RANGE_API_BOOL(min, max, choices)   ", 0 or 1"
#define API_RANGE_API_CHOICE(min, max, choices) ", " choices

struct api_counter {
    const char *name;
    size_t offset; /* of a uint32_t in the part's struct, if there is no get */
    uint64_t (*get)(const struct psabench_part *p);
};

#define API_COUNTER(prefix, part, member, field)                                                                       \
    {                                                                                                                  \
        prefix #field, offsetof(struct part, member.field), NULL                                                       \
    }

enum api_spi { API_NO_SPI, API_SPI_MODE0, API_SPI_MODE1 };

struct api_kind {
    const char *name;
    size_t size; /* of the part's struct, whose first member is struct psabench_part */
    const struct api_option *options;
    unsigned option_count;
    const char *options_text;
    const struct api_pin *pins;
    unsigned pin_count;
    const struct api_counter *counters;
    unsigned counter_count;
    uint16_t inputs, fn_inputs; /* bit i: has input i; asks psabench_input_fn for it */
    enum api_spi spi;
    /* Its options are set. Makes the device and switches it on; false with a sentence in why. */
    bool (*open)(struct psabench_part *p, char *why, size_t cap);
    void (*before_input)(struct psabench_part *p, int64_t t_ns); /* an input is about to change; may be NULL */
    void (*follow)(struct psabench_part *p, int64_t t_ns);       /* time has come here; may be NULL */
    void (*finish)(struct psabench_part *p, int64_t t_ns);       /* like follow, and holds nothing back; may be NULL */
    int (*peek)(const struct psabench_part *p, unsigned address);
    int64_t (*next_ns)(const struct psabench_part *p); /* an output may change then without an event; may be NULL */
    int64_t lag_ns;                                    /* how late it may tell an edge */
    bool board;                                        /* has frames and a controller */
};

extern const struct api_kind *const api_kinds[];
extern const unsigned api_kind_count;
extern const struct api_kind api_ads1281, api_ads1282, api_ads1255, api_ads1256, api_psa2;

struct api_watch {
    psabench_watch_fn *fn;
    void *ctx;
};

struct api_edge {
    int64_t t_ns;
    uint8_t pin, level;
};

/* Edges on their way to the recording: in order within a part, merged with the other parts' in order of time. */
struct api_queue {
    struct api_edge *edge;
    size_t head, len, cap;
};

struct psabench_part {
    const struct api_kind *kind;
    psabench *bench;
    struct psabench_part *next; /* in order of making */
    char name[API_NAME];
    uint32_t level;             /* as told last, outputs; as set last, inputs */
    uint32_t watched, recorded; /* pins */
    struct api_watch watch[API_PINS_MAX];
    unsigned inside; /* a callback from within its own code is running */
    psabench_input_fn *input;
    void *input_ctx;
    uint16_t by_fn; /* inputs that input() gives; the others are volts[] */
    double volts[API_INPUTS_MAX];
    uint32_t sclk_hz; /* option of every part with SPI */
    int64_t gap_ns;
    unsigned sclk, din, dout; /* pin numbers, API_NO_PIN */
    psabench_frame_fn *frame;
    void *frame_ctx;
    struct api_queue queue;
    unsigned first_code; /* of its pins in the recording */
};

struct api_vcd;

struct psabench {
    struct sched sched;
    uint64_t seed;
    struct psabench_part *parts;
    struct api_vcd *vcd;
    unsigned inside; /* time moves or a pin is being set: callbacks come from here */
    unsigned nested; /* psabench_set() within callbacks of psabench_set() */
    char error[API_ERROR];
};

/* Notes why, for psabench_error_text(), and returns code. b may be NULL. */
int api_fail(psabench *b, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* Whether time may move now; else a noted error. */
int api_may_move(psabench *b, const char *function);

/* Lets everything up to t_ns happen, each instant told as it comes. The caller has raised b->inside. */
void api_move(psabench *b, int64_t t_ns);

/* Tells what has changed since it was told last. */
void api_tell(psabench *b);

/* A pin has changed: to the recording, then to its watcher. */
void api_edge(struct psabench_part *p, unsigned pin, bool level, int64_t t_ns);

/* An input pin takes a level, without telling the outputs that follow. */
void api_drive(struct psabench_part *p, unsigned pin, bool level);

/* Volts (amperes) of an input at t_ns. */
double api_input(struct psabench_part *p, unsigned input, int64_t t_ns);

/* Stream of one of the part's noise sources. */
struct rng api_noise(const struct psabench_part *p, const char *source);
uint64_t api_serial(const struct psabench_part *p); /* made from its name */

/* Sets the options of a new part: the defaults, then the text. False with a sentence in why. */
bool api_options(struct psabench_part *p, const char *text, char *why, size_t cap);

/* Number of the pin of that name, or API_NO_PIN. */
unsigned api_find_pin(const struct api_kind *k, const char *name);

/* Recording. */
void api_vcd_put(struct psabench_part *p, unsigned pin, bool level, int64_t t_ns);
void api_vcd_follow(psabench *b);
int api_vcd_end(psabench *b); /* what is still on its way, closing time; 0 or an errno */

#endif
