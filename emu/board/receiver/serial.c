/* The serial port: messages into the transmit buffer, bytes out of it at the bit rate. */
#include "board/receiver/receiver.h"
#include "board/receiver/ubx.h"

#define BITS_A_BYTE 10                                      /* start, eight of data, stop */
#define UNIFORM(u)  (((double)((u) >> 11) + 0.5) * 0x1p-53) /* (0, 1) */

/* ---- TXD: edges only while someone watches them */

/* Of the byte under way: start, data from the least significant bit on, stop. */
static bool level_of(const struct receiver_tx *tx, unsigned bit)
{
    return (0x200u | (unsigned)tx->ring[tx->first] << 1) >> bit & 1;
}

/* When it begins. */
static int64_t bit_ns(const struct receiver_tx *tx, unsigned bit)
{
    return clk_edge_ns(&tx->clock, tx->bytes * BITS_A_BYTE + bit);
}

static void put_bit(void *ctx, int64_t t_ns)
{
    struct receiver *b = ctx;
    struct receiver_tx *tx = &b->tx;
    trace_set(&b->base.trace, RECEIVER_LINE_TXD, level_of(tx, tx->bit), t_ns);
    if (++tx->bit < BITS_A_BYTE) sched_at(b->base.sched, &tx->bit_ev, bit_ns(tx, tx->bit));
}

/* A client begins to watch: it gets what is left of the byte under way. */
void receiver_tx_wake(void *ctx, uint64_t mask)
{
    struct receiver *b = ctx;
    struct receiver_tx *tx = &b->tx;
    const uint64_t txd = TRACE_BIT(RECEIVER_LINE_TXD);
    const int64_t from_ns = b->base.trace.done_ns;
    if (!(mask & txd) || trace_watched(&b->base.trace, txd) || tx->count == 0 || tx->bit_ev.queued) return;
    for (tx->bit = 0; tx->bit < BITS_A_BYTE && bit_ns(tx, tx->bit) <= b->base.sched->now_ns; tx->bit++) {
        const struct trace_step step = {ns_later(bit_ns(tx, tx->bit), from_ns), txd, level_of(tx, tx->bit) ? txd : 0};
        if (bit_ns(tx, tx->bit + 1) > from_ns) trace_steps(&b->base.trace, &step, 1);
    }
    if (tx->bit < BITS_A_BYTE) sched_at(b->base.sched, &tx->bit_ev, bit_ns(tx, tx->bit));
}

static void begin_byte(struct receiver *b, int64_t t_ns)
{
    struct receiver_tx *tx = &b->tx;
    sched_at(b->base.sched, &tx->ev, bit_ns(tx, BITS_A_BYTE));
    tx->bit = 0;
    if (trace_watched(&b->base.trace, TRACE_BIT(RECEIVER_LINE_TXD))) put_bit(b, t_ns);
}

/* ---- the buffer */

static void send_byte(void *ctx, int64_t t_ns)
{
    struct receiver *b = ctx;
    struct receiver_tx *tx = &b->tx;
    const uint8_t byte = tx->ring[tx->first];
    tx->first = (tx->first + 1) % RECEIVER_TX_BYTES;
    tx->count--;
    tx->bytes++;
    if (tx->count) begin_byte(b, t_ns);
    if (tx->sent) tx->sent(tx->ctx, byte, t_ns);
}

void receiver_tx_init(struct receiver_tx *tx, const struct receiver_profile *p, struct receiver *b)
{
    tx->clock = (struct clk){.hz = p->baud, .div = 1};
    sched_ev_inner(&tx->ev, send_byte, b);
    sched_ev_inner(&tx->bit_ev, put_bit, b);
}

void receiver_tx_clear(struct receiver *b)
{
    sched_cancel(b->base.sched, &b->tx.ev);
    sched_cancel(b->base.sched, &b->tx.bit_ev);
    b->tx.count = 0;
}

/* The whole message or nothing. A burst begins with an idle line: its bits are counted from there. */
static void put_message(struct receiver *b, const uint8_t *bytes, unsigned n, int64_t t_ns)
{
    struct receiver_tx *tx = &b->tx;
    if (tx->count + n > RECEIVER_TX_BYTES) {
        b->counters.lost_messages++;
        return;
    }
    const bool idle = tx->count == 0;
    for (unsigned i = 0; i < n; i++) tx->ring[(tx->first + tx->count++) % RECEIVER_TX_BYTES] = bytes[i];
    b->counters.messages++;
    if (!idle) return;
    tx->clock.t0_ns = t_ns;
    tx->bytes = 0;
    begin_byte(b, t_ns);
}

/* A fault: the checksum of the message is wrong. Draws by the number of the message. */
static bool is_spoilt(const struct receiver *b)
{
    const int64_t number = (int64_t)b->counters.messages + b->counters.lost_messages;
    const double p = b->wrong.checksum_probability;
    return p > 0.0 && UNIFORM(draws_u64(&b->checksum, number)) < p;
}

static void put_sentence(struct receiver *b, const struct report *r, enum nmea_kind kind, int64_t t_ns)
{
    struct nmea s;
    nmea_write(r, kind, &s);
    if (is_spoilt(b)) {
        char *digit = &s.text[s.len - 3]; /* last of the checksum, before CR LF */
        *digit = *digit == '0' ? '1' : '0';
    }
    put_message(b, (const uint8_t *)s.text, s.len, t_ns);
}

static void put_pvt(struct receiver *b, const struct report *r, int64_t t_ns)
{
    uint8_t packet[UBX_PVT_LEN];
    ubx_write_pvt(r, packet);
    if (is_spoilt(b)) packet[UBX_PVT_LEN - 1] ^= 1;
    put_message(b, packet, UBX_PVT_LEN, t_ns);
}

void receiver_tx_report(struct receiver *b, const struct report *r, int64_t t_ns)
{
    for (unsigned i = 0; i < b->profile.message_count; i++) {
        const enum receiver_message m = b->profile.message[i];
        if (m == RECEIVER_PVT) put_pvt(b, r, t_ns);
        else put_sentence(b, r, (enum nmea_kind)m, t_ns);
    }
}
