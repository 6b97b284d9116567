/* libpsabench by its header: any part, any options, any calls in any order. Errors have a number and one line, levels are 0
 * or 1, time never runs back, and callbacks come in order. */
#include "fuzz.h"

#include "api/psabench.h"

#include <stdlib.h>
#include <string.h>

enum { PARTS_MAX = 3, STEPS_MAX = 200 };
#define END_NS 40000000

struct world {
    psabench *b;
    psabench_part *part[PARTS_MAX];
    unsigned parts;
    int64_t now_ns, told_ns[PARTS_MAX];
    struct script *s;
};

static int error(const struct world *w, int result)
{
    assert(result >= PSABENCH_VIOLATED);
    if (result < 0) assert(psabench_error_text(w->b)[0] && !strchr(psabench_error_text(w->b), '\n'));
    return result;
}

static void changed(void *ctx, psabench_part *p, int pin, int level, int64_t t_ns)
{
    const struct world *w = ctx;
    assert((level == 0 || level == 1) && psabench_pin_name(p, pin));
    assert(psabench_of(p) == w->b && t_ns >= 0 && t_ns <= psabench_now_ns(w->b));
}

/* A handler does what a driver does; the deadline is over when the script's time is. */
static void serve(void *ctx, psabench_part *p, int pin)
{
    const struct world *w = ctx;
    uint8_t word[3];
    assert(psabench_get(p, pin) >= PSABENCH_DEADLINE);
    error(w, psabench_spi(p, NULL, word, sizeof word));
    error(w, psabench_run_until_edge(p, pin, PSABENCH_EITHER, 10000));
    psabench_free(w->b); /* does nothing here */
}

static void late(void *ctx, psabench *b)
{
    const struct world *w = ctx;
    assert(w->b == b && strstr(psabench_error_text(b), "deadline: "));
}

static double volts(void *ctx, psabench_part *p, int input, int64_t t_ns)
{
    const struct world *w = ctx;
    assert(psabench_of(p) == w->b && input >= 0 && input <= 8 && t_ns <= psabench_now_ns(w->b));
    return input * 0.5;
}

static void frame(void *ctx, psabench_part *p, const struct psabench_frame *f)
{
    const struct world *w = ctx;
    assert(psabench_of(p) == w->b && f->size == sizeof *f && f->t_int_rise_ns > f->t_int_fall_ns);
}

/* Text of the script up to a NUL, cut to fit. */
static const char *text(struct script *s, char *buf, size_t cap)
{
    size_t n = 0;
    for (uint8_t c; script_more(s) && (c = script_byte(s));)
        if (n < cap - 1) buf[n++] = (char)c;
    buf[n] = '\0';
    return buf;
}

static void op_part(struct world *w, psabench_part *p)
{
    static const char *const parts[] = {"ads1281", "ads1282", "ads1255", "ads1256", "psa2",
                                        "adc",     "ad7710",  "ad7711a", "ad7712"};
    char options[200], name[40];
    (void)p;
    if (w->parts == PARTS_MAX) return;
    const uint8_t kind = script_byte(w->s);
    const char *part = parts[kind < 192 ? kind % 6 : 6 + kind % 3];
    const char *words = text(w->s, options, sizeof options);
    psabench_part *made = psabench_part_new(w->b, part, text(w->s, name, sizeof name), words);
    if (made) w->part[w->parts++] = made;
    else assert(psabench_error_text(w->b)[0] && !strchr(psabench_error_text(w->b), '\n'));
}

static void op_pins(struct world *w, psabench_part *p)
{
    const int pin = (int8_t)script_byte(w->s) % 20, level = (int8_t)script_byte(w->s) % 3;
    const int input = psabench_pin_is_input(p, pin), set = error(w, psabench_set(p, pin, level));
    assert(set != PSABENCH_OK || (input && (level == 0 || level == 1)));
    const int got = error(w, psabench_get(p, pin));
    assert(got <= 1);
    if (psabench_pin_name(p, pin)) assert(psabench_pin(p, psabench_pin_name(p, pin)) == pin);
}

static void op_watch(struct world *w, psabench_part *p)
{
    const uint8_t b = script_byte(w->s);
    error(w, psabench_watch(p, b % 18, b & 128 ? changed : NULL, w));
    if (b & 64) error(w, psabench_on_frame(p, b & 32 ? frame : NULL, w));
}

static void op_input(struct world *w, psabench_part *p)
{
    static const double v[] = {0.0, 1.0, -1.0, 2.5, 1e300, -5.0};
    static const uint8_t bits[] = {0, 1, 2, 3, 3, 2, 1, 0}; /* too many for one bit */
    const uint8_t b = script_byte(w->s);
    if ((b & 60) == 60) {
        error(w, psabench_play_bits(p, b & 128 ? bits : NULL, sizeof bits, (int)(b & 3)));
        return;
    }
    error(w, b & 128 ? psabench_set_input(p, b & 64 ? volts : NULL, w)
                     : psabench_set_volts(p, (int)(b % 10) - 1, v[b / 10 % 6]));
}

static void op_spi(struct world *w, psabench_part *p)
{
    uint8_t tx[16], rx[16];
    const uint8_t n = script_byte(w->s) % 17;
    for (unsigned i = 0; i < n; i++) tx[i] = script_byte(w->s);
    error(w, psabench_spi(p, n & 1 ? tx : NULL, n & 2 ? rx : NULL, n));
}

static void op_clock(struct world *w, psabench_part *p)
{
    const uint32_t hz = (uint32_t)script_uint(w->s, 3);
    error(w, psabench_spi_clock(p, hz > 50000 || hz == 0 ? hz : 50000, script_span_ns(w->s) % 100000 - 1));
}

static void op_run(struct world *w, psabench_part *p)
{
    const uint8_t b = script_byte(w->s);
    const int64_t dt_ns = script_span_ns(w->s) - 1;
    if (b & 1) error(w, psabench_run_until_level(p, b >> 2 & 31, b >> 1 & 1, dt_ns));
    else error(w, psabench_run_for(w->b, dt_ns));
}

static void op_wait(struct world *w, psabench_part *p)
{
    const uint8_t b = script_byte(w->s);
    const int pin = script_byte(w->s) % 20;
    const int64_t dt_ns = script_span_ns(w->s) - 1;
    const int edge = b >> 3 & 3;
    switch (b & 7) {
    case 0:
    case 1:
        error(w, psabench_run_until_edge(p, pin, edge, dt_ns));
        break;
    case 2:
    case 3:
        error(w, psabench_on_interrupt(p, pin, edge, b & 128 ? serve : NULL, w));
        break;
    case 4:
        error(w, psabench_mask(w->b, edge));
        break;
    case 5:
        error(w, psabench_run_until_interrupt(w->b, dt_ns));
        break;
    case 6:
        error(w, psabench_deadline(w->b, b & 128 ? INT64_MAX : psabench_now_ns(w->b) + dt_ns, b & 64 ? late : NULL, w));
        break;
    default:
        error(w, psabench_check(p));
    }
}

static void op_next(struct world *w, psabench_part *p)
{
    const int64_t next_ns = psabench_next_ns(w->b);
    (void)p;
    if (next_ns < END_NS) error(w, psabench_run_until(w->b, next_ns + script_byte(w->s) % 3 - 1));
}

static void op_look(struct world *w, psabench_part *p)
{
    uint64_t v;
    const unsigned address = (unsigned)script_uint(w->s, 2);
    assert(error(w, psabench_peek(p, address)) <= 255);
    for (int i = 0; psabench_counter(p, i, &v); i++)
        assert(i < 200 && psabench_count(p, psabench_counter(p, i, NULL)) == (int64_t)v);
}

static void op_board(struct world *w, psabench_part *p)
{
    const uint8_t b = script_byte(w->s), value = script_byte(w->s);
    const int64_t timeout_ns = script_span_ns(w->s);
    if (b & 128) error(w, psabench_board_write(p, b >> 4 & 7, b & 15, value, timeout_ns));
    else assert(error(w, psabench_board_read(p, b >> 4 & 7, b & 15, timeout_ns)) <= 255);
}

static void op_vcd(struct world *w, psabench_part *p)
{
    (void)p;
    error(w, script_byte(w->s) & 1 ? psabench_vcd(w->b, "/dev/null") : psabench_vcd_close(w->b));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static void (*const ops[])(struct world * w, psabench_part * p) = {
        op_run, op_pins, op_watch, op_input, op_spi, op_clock, op_next, op_look, op_board, op_vcd, op_wait, op_part,
    };
    struct script s = script_of(data, size);
    struct world w = {.b = psabench_new(1), .s = &s};
    if (!w.b) abort();
    op_part(&w, NULL);
    for (unsigned i = 0; i < STEPS_MAX && script_more(&s) && w.parts && w.now_ns < END_NS; i++) {
        const uint8_t b = script_byte(&s);
        ops[b % (sizeof ops / sizeof ops[0])](&w, w.part[b / 16 % w.parts]);
        /* What a slow WAKEUP has set off may be due now: an ADS1256 looks at its input from the byte's first SCLK on. */
        assert(psabench_now_ns(w.b) >= w.now_ns && psabench_next_ns(w.b) >= psabench_now_ns(w.b));
        w.now_ns = psabench_now_ns(w.b);
    }
    psabench_free(w.b);
    return 0;
}
