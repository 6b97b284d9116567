#include "bench/digest.h"

#include "board/digest.h"

static void add_bus(struct sha256 *s, const struct can_bus *b, uint64_t traffic)
{
    board_digest_u64(s, b->frames);
    board_digest_u64(s, b->number);
    board_digest_u64(s, (uint64_t)b->phase);
    board_digest_u64(s, (uint64_t)b->busy_ns);
    board_digest_u64(s, traffic);
}

static void add_uds(struct sha256 *s, const struct uds_door *d)
{
    board_digest_u64(s, (uint64_t)d->server.session << 32 | (uint64_t)d->server.state);
    board_digest_u64(s, (uint64_t)d->transport.tx.state << 32 | (uint64_t)d->transport.rx.state);
    board_digest_u64(s, (uint64_t)d->server.requests << 32 | d->server.negatives);
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
    const struct scenario_unit *cfg = &b->scenario.units[i];
    if (cfg->uds_ecu) add_uds(s, &b->uds[cfg->bus][cfg->uds_ecu - 1]);
}

/* Nothing where nothing pushes. */
static void add_push(struct sha256 *s, const struct vehicle *v)
{
    const struct vehicle_plan *p = &v->plan[v->commands % VEHICLE_HISTORY];
    for (unsigned k = 0; k < sizeof p->push / sizeof *p->push; k++) {
        if (p->push[k].amplitude == 0.0) continue;
        board_digest_u64(s, (uint64_t)p->push[k].from_ns << 1 | k);
        board_digest_real(s, p->push[k].amplitude);
        board_digest_real(s, p->push[k].rate_radps);
    }
}

static void add_platform(struct sha256 *s, struct platform *p, int64_t t_ns)
{
    struct platform_state at;
    platform_at(p, t_ns, &at); /* truth changes nothing */
    const double real[] = {at.alpha_rad,       at.beta_rad,        at.gamma_rad,       at.q_rad,
                           at.drift_radps[0],  at.drift_radps[1],  at.torque_radps[0], at.torque_radps[1],
                           p->setting.set_rad, p->setting.read_rad};
    for (unsigned i = 0; i < sizeof real / sizeof *real; i++) board_digest_real(s, real[i]);
    for (unsigned i = 0; i < 4; i++) board_digest_u64(s, p->draws.s[i]);
    board_digest_u64(s, (uint64_t)p->vehicle.commands << 1 | p->stuck);
    add_push(s, &p->vehicle);
}

void digest_bench(const struct bench *b, const struct journal *j, char hex[SHA256_HEX])
{
    struct sha256 s;
    sha256_init(&s);
    board_digest_u64(&s, (uint64_t)b->sched.now_ns);
    for (unsigned i = 0; i < b->buses; i++) add_bus(&s, &b->bus[i], j->tap[i].traffic);
    for (unsigned i = 0; i < b->scenario.unit_count; i++) add_unit(&s, b, i);
    if (b->lab.platform.cfg.present) add_platform(&s, (struct platform *)&b->lab.platform, b->sched.now_ns);
    sha256_hex(&s, hex);
}
