#include "app/digest.h"

#include "board/board_digest.h"

static void add_bus(struct sha256 *s, const struct can_bus *b, uint64_t traffic)
{
    board_digest_u64(s, b->frames);
    board_digest_u64(s, b->number);
    board_digest_u64(s, (uint64_t)b->phase);
    board_digest_u64(s, (uint64_t)b->busy_ns);
    board_digest_u64(s, traffic);
}

static void add_unit(struct sha256 *s, const struct bench *b, unsigned i)
{
    struct unit *u = (struct unit *)&b->unit[i]; /* truth changes nothing */
    const struct can_node *n = unit_node(u);
    u->type->digest(u->board, s);
    for (unsigned k = 0; k < UNIT_AXES; k++) {
        board_digest_noise(s, &u->mems[k].noise);
        board_digest_noise(s, &u->quartz[k].noise);
        board_digest_real(s, unit_sensor_out(u, k, b->sched.now_ns));
    }
    board_digest_u64(s, (uint64_t)n->tx_frames << 32 | n->rx_frames);
    board_digest_u64(s, (uint64_t)n->tx_overflow << 32 | n->queued);
}

void digest_bench(const struct bench *b, const struct journal *j, char hex[SHA256_HEX])
{
    struct sha256 s;
    sha256_init(&s);
    board_digest_u64(&s, (uint64_t)b->sched.now_ns);
    for (unsigned i = 0; i < b->buses; i++) add_bus(&s, &b->bus[i], j->tap[i].traffic);
    for (unsigned i = 0; i < b->scenario.unit_count; i++) add_unit(&s, b, i);
    sha256_hex(&s, hex);
}
