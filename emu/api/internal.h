/* What the files of libpsabench share: the bench and its parts. Not for others.
 *
 * A kind of part is one const row of tables: options, pins, counters, and a handful of functions. Nothing else in here
 * knows a chip. Outputs are compared with the levels last reported after every stimulus and every event; only
 * pins that are watched or recorded. */
#ifndef PSABENCH_API_INTERNAL_H
#define PSABENCH_API_INTERNAL_H

#include "api/kind.h"
#include "api/psabench.h"
#include "base/draws.h"
#include "base/reg.h"
#include "base/sched.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { API_PINS_MAX = 32, API_INPUTS_MAX = 9, API_NAME = 32, API_ERROR = 400, API_WHY = 300 };

#define API_NO_PIN      255u
#define API_TIME_MAX_NS (INT64_C(1) << 60) /* 36 years */
#define API_STEP_NS     50000
#define API_VOLTS_MAX   1e6

struct api_watch {
    psabench_watch_fn *fn;
    void *ctx;
};

struct api_interrupt {
    psabench_interrupt_fn *fn;
    void *ctx;
    enum psabench_edge edge;
};

struct api_deadline {
    int64_t t_ns;
    psabench_deadline_fn *fn;
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
    uint32_t level;             /* as reported last, outputs; as set last, inputs */
    uint32_t watched, recorded; /* pins */
    uint32_t counted;           /* pins whose edges are counted for psabench_run_until_edge() */
    uint32_t armed, pending;    /* pins with an interrupt; those whose interrupt waits to be served */
    struct api_watch watch[API_PINS_MAX];
    struct api_interrupt interrupt[API_PINS_MAX];
    uint32_t edges[API_PINS_MAX][2]; /* by the new level; they wrap */
    unsigned inside;                 /* a callback from within its own code is running */
    psabench_input_fn *input;
    void *input_ctx;
    uint16_t by_fn; /* inputs that input() gives; the others are volts[] */
    double volts[API_INPUTS_MAX];
    uint32_t sclk_hz;  /* option of every part with SPI */
    double source_ohm; /* option of parts whose inputs load their sources */
    int64_t gap_ns;
    unsigned sclk, din, dout; /* pin numbers, API_NO_PIN */
    psabench_frame_fn *frame;
    void *frame_ctx;
    struct api_queue queue;
    unsigned first_code; /* of its pins in the recording */
};

struct api_vcd;
struct psa2_profile;

struct psabench {
    struct sched sched;
    uint64_t seed;
    struct psabench_part *parts;
    struct api_vcd *vcd;
    unsigned inside; /* time moves or a pin is being set: callbacks come from here */
    unsigned nested; /* psabench_set() within callbacks of psabench_set() */
    struct api_deadline deadline;
    unsigned polls; /* pins read since time has passed, poll_ns */
    int64_t poll_ns;
    bool masked, serving; /* interrupts wait; one is being served */
    uint32_t served;      /* interrupts so far; it wraps */
    char error[API_ERROR];
};

/* Notes why, for psabench_error_text(), and returns code. b may be NULL. */
int api_fail(psabench *b, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* A pin has changed: to the recording, then to its watcher. */
void api_edge(struct psabench_part *p, unsigned pin, bool level, int64_t t_ns);

/* An input pin takes a level, without telling the outputs that follow. */
void api_drive(struct psabench_part *p, unsigned pin, bool level);

/* Volts (amperes) of an input at t_ns. */
double api_input(struct psabench_part *p, unsigned input, int64_t t_ns);

/* Resistance behind each input, for a chip that asks: ctx is the part. NULL where the option is 0. */
typedef double api_source_fn(void *ctx, unsigned input, int64_t t_ns);
api_source_fn *api_source(const struct psabench_part *p);

/* Stream of one of the part's noise sources. */
struct draws api_noise(const struct psabench_part *p, const char *source);
uint64_t api_serial(const struct psabench_part *p); /* made from its name */

/* For a chip that calls at each change of a pin: the pin is read after the event that moved it. */
void api_ignore_edge(void *ctx, bool level, int64_t t_ns);

/* Sets the options of a new part: the defaults, then the text. False with a sentence in why. */
bool api_options(struct psabench_part *p, const char *text, char *why, size_t cap);

/* A built-in board profile of the psa2 by its number in the option "profile". False with a sentence in why if no board can
 * run it. */
bool api_psa2_profile(unsigned number, struct psa2_profile *p, char *why, size_t cap);

/* " A B C" into list: names of a table whose rows of the size begin with them. */
void api_list(const void *rows, size_t size, unsigned count, char list[API_WHY]);

/* Number of the pin of that name, or API_NO_PIN. */
unsigned api_find_pin(const struct api_kind *k, const char *name);

/* Recording; 0 or an errno. */
int api_vcd_begin(psabench *b, const char *path);
void api_vcd_put(struct psabench_part *p, unsigned pin, bool level, int64_t t_ns);
void api_vcd_follow(psabench *b);
int api_vcd_end(psabench *b); /* what is still on its way, closing time */

#include "api/run.h" /* IWYU pragma: export */

#endif
