#include "api/internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

unsigned api_find_pin(const struct api_kind *k, const char *name)
{
    for (unsigned i = 0; i < k->pin_count; i++)
        if (strcmp(k->pins[i].name, name) == 0) return i;
    return API_NO_PIN;
}

void api_list(const void *rows, size_t size, unsigned count, char list[API_WHY])
{
    size_t len = 0;
    list[0] = '\0';
    for (unsigned i = 0; i < count && len < API_WHY; i++) {
        const char *const *name = (const void *)((const char *)rows + i * size);
        len += (size_t)snprintf(list + len, API_WHY - len, " %s", *name);
    }
}

/* FNV-1a: a name's own number, the same on every machine. */
uint64_t api_serial(const struct psabench_part *p)
{
    uint64_t hash = UINT64_C(14695981039346656037);
    for (const char *c = p->name; *c; c++) hash = (hash ^ (unsigned char)*c) * UINT64_C(1099511628211);
    return hash;
}

struct draws api_noise(const struct psabench_part *p, const char *source)
{
    return draws_of(p->bench->seed, api_serial(p), source);
}

psabench *psabench_of(const psabench_part *p)
{
    return p ? p->bench : NULL;
}

const char *psabench_part_name(const psabench_part *p)
{
    return p ? p->name : NULL;
}

/* ---- pins ---- */

static int no_such_pin(const psabench_part *p, const char *name)
{
    char list[API_WHY];
    api_list(p->kind->pins, sizeof *p->kind->pins, p->kind->pin_count, list);
    return api_fail(p->bench, PSABENCH_BAD_ARGUMENT, "%s: pin of %s: expected one of%s, got %.40s", p->name,
                    p->kind->name, list, name ? name : "NULL");
}

int psabench_pin(const psabench_part *p, const char *name)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    const unsigned pin = name ? api_find_pin(p->kind, name) : API_NO_PIN;
    return pin != API_NO_PIN ? (int)pin : no_such_pin(p, name);
}

const struct api_pin *api_pin_of(const psabench_part *p, int pin)
{
    return p && pin >= 0 && (unsigned)pin < p->kind->pin_count ? &p->kind->pins[pin] : NULL;
}

int api_no_pin(const psabench_part *p, int pin)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    return api_fail(p->bench, PSABENCH_BAD_ARGUMENT, "%s: pin number: expected 0 to %u, got %d", p->name,
                    p->kind->pin_count - 1, pin);
}

const char *psabench_pin_name(const psabench_part *p, int pin)
{
    const struct api_pin *row = api_pin_of(p, pin);
    return row ? row->name : NULL;
}

int psabench_pin_is_input(const psabench_part *p, int pin)
{
    const struct api_pin *row = api_pin_of(p, pin);
    return row ? row->dir != API_OUT : api_no_pin(p, pin);
}

/* Only known when the burst that it belongs to is over. */
int api_not_late(const psabench_part *p, const struct api_pin *row)
{
    if (row->dir != API_OUT || row->get) return PSABENCH_OK;
    return api_fail(p->bench, PSABENCH_NOT_HERE, "%s: %s: the level is known only after the burst; watch or record it",
                    p->name, row->name);
}

int psabench_get(const psabench_part *p, int pin)
{
    const struct api_pin *row = api_pin_of(p, pin);
    if (!row) return api_no_pin(p, pin);
    const int late = api_not_late(p, row);
    if (late) return late;
    const int vain = api_poll(p->bench);
    return vain ? vain : api_level(p, (unsigned)pin);
}

void api_drive(struct psabench_part *p, unsigned pin, bool level)
{
    const struct api_pin *row = &p->kind->pins[pin];
    const int64_t t_ns = p->bench->sched.now_ns;
    row->set(p, row->arg, level, t_ns);
    if (row->dir == API_IN && level != (p->level >> pin & 1)) api_edge(p, pin, level, t_ns);
}

int psabench_set(psabench_part *p, int pin, int level)
{
    enum { NESTED_MAX = 16 };
    const struct api_pin *row = api_pin_of(p, pin);
    if (!row) return api_no_pin(p, pin);
    psabench *b = p->bench;
    if (row->dir == API_OUT || (level != 0 && level != 1))
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: %s: expected %s, got %d", p->name, row->name,
                        row->dir == API_OUT ? "an input" : "0 or 1", level);
    if (p->inside || b->nested >= NESTED_MAX)
        return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: %s: expected a call outside %s", p->name, row->name,
                        p->inside ? "a callback that the same part is waiting for"
                                  : "nested callbacks of psabench_set()");
    b->inside++;
    b->nested++;
    api_drive(p, (unsigned)pin, level);
    api_notify(b);
    b->nested--;
    b->inside--;
    return PSABENCH_OK;
}

void api_observe(psabench_part *p, unsigned pin)
{
    const struct api_pin *row = &p->kind->pins[pin];
    const uint32_t bit = UINT32_C(1) << pin;
    if (!row->get || api_observed(p) & bit) return;
    p->level = row->get(p, row->arg) ? p->level | bit : p->level & ~bit;
}

int psabench_watch(psabench_part *p, int pin, psabench_watch_fn *fn, void *ctx)
{
    const struct api_pin *row = api_pin_of(p, pin);
    if (!row) return api_no_pin(p, pin);
    if (row->dir == API_IN)
        return api_fail(p->bench, PSABENCH_BAD_ARGUMENT, "%s: %s: expected an output, got an input", p->name,
                        row->name);
    const uint32_t bit = UINT32_C(1) << pin;
    api_observe(p, (unsigned)pin);
    p->watch[pin] = (struct api_watch){fn, ctx};
    p->watched = fn ? p->watched | bit : p->watched & ~bit;
    if (!p->inside && p->kind->follow) p->kind->follow(p, p->bench->sched.now_ns);
    return PSABENCH_OK;
}

/* ---- inputs ---- */

double api_input(struct psabench_part *p, unsigned input, int64_t t_ns)
{
    if (!(p->by_fn >> input & 1)) return p->volts[input];
    p->inside++;
    const double v = p->input(p->input_ctx, p, (int)input, t_ns);
    p->inside--;
    if (!isfinite(v)) return 0.0;
    return v > API_VOLTS_MAX ? API_VOLTS_MAX : v < -API_VOLTS_MAX ? -API_VOLTS_MAX : v;
}

/* The past is sampled with the input as it was. */
static int before_input(struct psabench_part *p, const char *function)
{
    if (p->inside)
        return api_fail(p->bench, PSABENCH_BAD_ARGUMENT,
                        "%s: %s: expected a call outside a callback that the same part is waiting for", p->name,
                        function);
    p->bench->inside++;
    if (p->kind->before_input) p->kind->before_input(p, p->bench->sched.now_ns);
    p->bench->inside--;
    return PSABENCH_OK;
}

int psabench_set_input(psabench_part *p, psabench_input_fn *fn, void *ctx)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    const int bad = before_input(p, "psabench_set_input()");
    if (bad) return bad;
    p->input = fn;
    p->input_ctx = ctx;
    p->by_fn = fn ? p->kind->fn_inputs : 0;
    return PSABENCH_OK;
}

static int no_such_input(const psabench_part *p, int input)
{
    char list[API_WHY] = "";
    size_t len = 0;
    for (unsigned i = 0; i < API_INPUTS_MAX && len < sizeof list; i++)
        if (p->kind->inputs >> i & 1) len += (size_t)snprintf(list + len, sizeof list - len, " %u", i);
    return api_fail(p->bench, PSABENCH_BAD_ARGUMENT, "%s: input of %s: expected one of%s, got %d", p->name,
                    p->kind->name, list, input);
}

int psabench_set_volts(psabench_part *p, int input, double volts)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    if (input < 0 || input >= API_INPUTS_MAX || !(p->kind->inputs >> input & 1)) return no_such_input(p, input);
    if (!(volts >= -API_VOLTS_MAX && volts <= API_VOLTS_MAX))
        return api_fail(p->bench, PSABENCH_BAD_ARGUMENT, "%s: input %d: expected volts within +-%g, got %g", p->name,
                        input, (double)API_VOLTS_MAX, volts);
    const int bad = before_input(p, "psabench_set_volts()");
    if (bad) return bad;
    p->volts[input] = volts;
    p->by_fn &= (uint16_t) ~(1u << input);
    return PSABENCH_OK;
}

static int check_bits(const psabench_part *p, const uint8_t *bits, size_t n, int kind)
{
    psabench *b = p->bench;
    if (!p->kind->play_bits)
        return api_fail(b, PSABENCH_NOT_HERE, "%s: psabench_play_bits(): expected an ads1281 or ads1282, got %s",
                        p->name, p->kind->name);
    if (!bits) return PSABENCH_OK;
    if (kind != PSABENCH_ONE_BIT && kind != PSABENCH_M0_M1)
        return api_fail(b, PSABENCH_BAD_ARGUMENT,
                        "%s: kind of bits: expected PSABENCH_ONE_BIT or PSABENCH_M0_M1, got %d", p->name, kind);
    const unsigned most = kind == PSABENCH_ONE_BIT ? 1 : 3;
    for (size_t i = 0; i < n; i++)
        if (bits[i] > most)
            return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: bits of clock %zu: expected 0 to %u, got %u", p->name, i,
                            most, bits[i]);
    return PSABENCH_OK;
}

int psabench_play_bits(psabench_part *p, const uint8_t *bits, size_t n, int kind)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    int bad = check_bits(p, bits, n, kind);
    if (!bad) bad = before_input(p, "psabench_play_bits()");
    if (bad) return bad;
    p->bench->inside++;
    p->kind->play_bits(p, bits, n, kind == PSABENCH_ONE_BIT, p->bench->sched.now_ns);
    api_notify(p->bench);
    p->bench->inside--;
    return PSABENCH_OK;
}

/* ---- inside ---- */

void api_ignore_edge(void *ctx, bool level, int64_t t_ns)
{
    (void)ctx;
    (void)level;
    (void)t_ns;
}

static double source_ohm(void *ctx, unsigned input, int64_t t_ns)
{
    (void)input;
    (void)t_ns;
    return ((const struct psabench_part *)ctx)->source_ohm;
}

api_source_fn *api_source(const struct psabench_part *p)
{
    return p->source_ohm > 0.0 ? source_ohm : NULL;
}

static int peek_reg(const struct psabench_part *p, unsigned address)
{
    const struct reg_file *f = (const void *)((const char *)p + p->kind->regs);
    return address < f->count && f->map[address].name ? reg_peek(f, address) : -1;
}

int psabench_peek(const psabench_part *p, unsigned address)
{
    if (!p) return PSABENCH_BAD_ARGUMENT;
    const int value = p->kind->peek ? p->kind->peek(p, address) : peek_reg(p, address);
    if (value >= 0) return value;
    return api_fail(p->bench, PSABENCH_BAD_ARGUMENT, "%s: expected a register of %s, got %03Xh", p->name, p->kind->name,
                    address);
}
