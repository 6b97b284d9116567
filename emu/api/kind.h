/* What a kind of part is made of: tables of options, pins and counters, and a handful of functions. Not for others. */
#ifndef PSABENCH_API_KIND_H
#define PSABENCH_API_KIND_H

#include "api/psabench.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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

/* Pin functions that only pass a level on to the function of the device, member chip of struct `part`, or get it there. */
#define API_SET_PIN(name, part, function)                                                                              \
    static void name(struct psabench_part *p, unsigned arg, bool level, int64_t t_ns)                                  \
    {                                                                                                                  \
        (void)arg;                                                                                                     \
        function(&((struct part *)p)->chip, level, t_ns);                                                              \
    }                                                                                                                  \
    struct part /* so that a semicolon has to follow */
#define API_GET_PIN(name, part, function)                                                                              \
    static bool name(const struct psabench_part *p, unsigned arg)                                                      \
    {                                                                                                                  \
        (void)arg;                                                                                                     \
        return function(&((const struct part *)p)->chip);                                                              \
    }                                                                                                                  \
    struct part /* so that a semicolon has to follow */

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
    bool violation; /* 0 while the program keeps to the data sheet */
};

#define API_COUNTER(name, part, member)                                                                                \
    {                                                                                                                  \
        name, offsetof(struct part, member), NULL, false                                                               \
    }
#define API_VIOLATION(name, part, member)                                                                              \
    {                                                                                                                  \
        name, offsetof(struct part, member), NULL, true                                                                \
    }
#define API_COUNTER_GET(member)                                                                                        \
    {                                                                                                                  \
        .name = #member, .get = (member)                                                                               \
    }

/* A table, and how many rows it has in the member after it. */
#define API_ROWS(rows) (rows), sizeof(rows) / sizeof *(rows)

enum api_spi { API_NO_SPI, API_SPI_MODE0, API_SPI_MODE1 };

struct api_kind {
    const char *name;
    int variant; /* of the device: which of its family */
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
    void (*open)(struct psabench_part *p); /* its options are set: makes the device and switches it on */
    void (*before_input)(struct psabench_part *p, int64_t t_ns); /* an input is about to change; may be NULL */
    /* The bits of a modulator in place of its own; checked. May be NULL. */
    void (*play_bits)(struct psabench_part *p, const uint8_t *bits, size_t n, bool one_bit, int64_t t_ns);
    void (*follow)(struct psabench_part *p, int64_t t_ns);        /* time has come here; may be NULL */
    void (*finish)(struct psabench_part *p, int64_t t_ns);        /* like follow, and holds nothing back; may be NULL */
    size_t regs;                                                  /* of its struct reg_file in the part's struct, or */
    int (*peek)(const struct psabench_part *p, unsigned address); /* a register by other means; -1: there is none */
    int64_t (*next_ns)(const struct psabench_part *p); /* an output may change then without an event; may be NULL */
    int64_t lag_ns;                                    /* how late it may report an edge */
    bool board;                                        /* has frames and a controller */
};

extern const struct api_kind *const api_kinds[];
extern const unsigned api_kind_count;
extern const struct api_kind api_ads1281, api_ads1282, api_ads1255, api_ads1256, api_psa2;
extern const struct api_kind api_ad7710, api_ad7711, api_ad7711a, api_ad7712;

#endif
