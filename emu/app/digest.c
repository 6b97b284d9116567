#include "app/digest.h"

#include <string.h>

static void add(struct sha256 *s, uint64_t x)
{
    uint8_t bytes[8];
    for (unsigned i = 0; i < 8; i++) bytes[i] = (uint8_t)(x >> (8 * i));
    sha256_add(s, bytes, sizeof bytes);
}

static void add_real(struct sha256 *s, double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    add(s, bits);
}

static void add_noise(struct sha256 *s, const struct rng *r)
{
    for (unsigned i = 0; i < 4; i++) add(s, r->s[i]);
}

static void add_bus(struct sha256 *s, const struct can_bus *b, uint64_t traffic)
{
    add(s, b->frames);
    add(s, b->number);
    add(s, (uint64_t)b->phase);
    add(s, (uint64_t)b->busy_ns);
    add(s, traffic);
}

static void add_ads1282(struct sha256 *s, const struct ads1282 *a)
{
    sha256_add(s, a->reg_value, sizeof a->reg_value);
    add_noise(s, &a->noise);
    add(s, (uint64_t)a->period);
    add(s, (uint64_t)a->index);
    add(s, (uint64_t)a->last_lsb);
    add(s, a->out);
}

static void add_ads1256(struct sha256 *s, const struct ads1256 *a)
{
    sha256_add(s, a->value, sizeof a->value);
    add_noise(s, &a->noise);
    add(s, (uint64_t)a->cell);
    add(s, (uint64_t)a->ready);
    add(s, (uint64_t)a->word);
}

static void add_board(struct sha256 *s, const struct psa2 *b)
{
    const struct psa2_counters *c = &b->counters;
    add(s, (uint64_t)b->mode << 32 | b->seq);
    add(s, (uint64_t)b->drd_a_ns);
    add(s, (uint64_t)c->frames << 32 | c->resets);
    add(s, (uint64_t)c->requests << 32 | c->timeouts);
    add(s, (uint64_t)c->overruns << 32 | c->int_late);
    for (unsigned i = 0; i < 3; i++) add(s, (uint64_t)b->latest.code[i]);
    for (unsigned i = 0; i < 3; i++) add_ads1282(s, &b->adc[i]);
    add_ads1256(s, &b->tadc);
}

static void add_unit(struct sha256 *s, const struct bench *b, unsigned i)
{
    struct unit *u = (struct unit *)&b->unit[i]; /* truth changes nothing */
    const struct can_node *n = &b->can[i].node.stream;
    add_board(s, &u->board);
    for (unsigned k = 0; k < UNIT_AXES; k++) {
        add_noise(s, &u->mems[k].noise);
        add_noise(s, &u->quartz[k].noise);
        add_real(s, unit_sensor_out(u, k, b->sched.now_ns));
    }
    add(s, (uint64_t)n->tx_frames << 32 | n->rx_frames);
    add(s, (uint64_t)n->tx_overflow << 32 | n->queued);
}

void digest_bench(const struct bench *b, const struct journal *j, char hex[SHA256_HEX])
{
    struct sha256 s;
    sha256_init(&s);
    add(&s, (uint64_t)b->sched.now_ns);
    for (unsigned i = 0; i < b->buses; i++) add_bus(&s, &b->bus[i], j->tap[i].traffic);
    for (unsigned i = 0; i < b->scenario.unit_count; i++) add_unit(&s, b, i);
    sha256_hex(&s, hex);
}
