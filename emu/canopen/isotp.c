#include "canopen/isotp.h"

#include <assert.h>
#include <string.h>

/* Bits 7..4 of the first byte (N_PCI, 9.6), flow status (9.6.5). */
enum { PCI_SINGLE, PCI_FIRST, PCI_CONSECUTIVE, PCI_FLOW };
enum { FS_CONTINUE, FS_WAIT, FS_OVERFLOW };
enum { SINGLE_MAX = 7, FIRST_DATA = 6, CONSECUTIVE_MAX = 7, FRAME = 8, FLOW_MIN = 3, SN_MASK = 15 };
enum { NS_PER_MS = 1000000, NS_PER_100US = 100000 };

/* 9.6.5; a reserved value means the longest. */
static int64_t separation_ns(uint8_t st_min)
{
    enum { MS_MAX = 0x7F, US_FIRST = 0xF1, US_LAST = 0xF9 };
    if (st_min >= US_FIRST && st_min <= US_LAST) return (int64_t)(st_min - US_FIRST + 1) * NS_PER_100US;
    return (int64_t)(st_min <= MS_MAX ? st_min : MS_MAX) * NS_PER_MS;
}

static void pad_frame(uint8_t frame[FRAME], size_t from)
{
    memset(&frame[from], ISOTP_PADDING, FRAME - from);
}

/* ---- sending ---- */

static void finish_tx(struct isotp *p, enum isotp_result r, int64_t t_ns)
{
    p->tx.state = ISOTP_TX_IDLE;
    sched_cancel(p->sched, &p->tx.timer);
    if (r != ISOTP_OK) p->failed[r]++;
    p->io.done(p->io.ctx, r, t_ns);
}

static void wait_tx(struct isotp *p, enum isotp_tx state, int64_t span_ns, int64_t t_ns)
{
    p->tx.state = state;
    sched_at(p->sched, &p->tx.timer, t_ns + span_ns);
}

/* The next n bytes of the message, behind the first `head` bytes of the frame. */
static void put_tx(struct isotp *p, enum isotp_tx state, size_t head, size_t n, int64_t t_ns)
{
    memcpy(&p->tx.frame[head], &p->tx.data[p->tx.at], n);
    pad_frame(p->tx.frame, head + n);
    p->tx.at += n;
    wait_tx(p, state, ISOTP_TIMEOUT_NS, t_ns);
    p->io.send(p->io.ctx, p->tx.frame, t_ns);
}

static void send_consecutive(struct isotp *p, int64_t t_ns)
{
    const size_t left = p->tx.size - p->tx.at;
    p->tx.frame[0] = (uint8_t)(PCI_CONSECUTIVE << 4 | p->tx.sn);
    p->tx.sn = (p->tx.sn + 1) & SN_MASK;
    put_tx(p, ISOTP_TX_CONSECUTIVE, 1, left < CONSECUTIVE_MAX ? left : CONSECUTIVE_MAX, t_ns);
}

bool isotp_send(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns)
{
    if (p->tx.state != ISOTP_TX_IDLE || len == 0 || len > ISOTP_MAX) return false;
    p->tx.data = data;
    p->tx.size = len;
    p->tx.at = 0;
    p->tx.sn = 1;
    if (len <= SINGLE_MAX) {
        p->tx.frame[0] = (uint8_t)(PCI_SINGLE << 4 | len);
        put_tx(p, ISOTP_TX_SINGLE, 1, len, t_ns);
    } else {
        p->tx.frame[0] = (uint8_t)(PCI_FIRST << 4 | len >> 8);
        p->tx.frame[1] = (uint8_t)len;
        put_tx(p, ISOTP_TX_FIRST, 2, FIRST_DATA, t_ns);
    }
    return true;
}

static void consecutive_sent(struct isotp *p, int64_t t_ns)
{
    if (p->tx.at == p->tx.size) finish_tx(p, ISOTP_OK, t_ns);
    else if (p->tx.block_left && --p->tx.block_left == 0) wait_tx(p, ISOTP_TX_FLOW, ISOTP_TIMEOUT_NS, t_ns);
    else if (p->tx.gap_ns) wait_tx(p, ISOTP_TX_GAP, p->tx.gap_ns, t_ns);
    else send_consecutive(p, t_ns);
}

static void tx_due(void *ctx, int64_t t_ns)
{
    struct isotp *p = ctx;
    if (p->tx.state == ISOTP_TX_GAP) send_consecutive(p, t_ns);
    else finish_tx(p, p->tx.state == ISOTP_TX_FLOW ? ISOTP_TIMEOUT_BS : ISOTP_TIMEOUT_A, t_ns);
}

static void on_flow(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns)
{
    if (p->tx.state != ISOTP_TX_FLOW || len < FLOW_MIN) {
        p->ignored++;
        return;
    }
    switch (data[0] & 15) {
    case FS_CONTINUE:
        p->tx.block_left = data[1];
        p->tx.gap_ns = separation_ns(data[2]);
        send_consecutive(p, t_ns);
        return;
    case FS_WAIT:
        wait_tx(p, ISOTP_TX_FLOW, ISOTP_TIMEOUT_NS, t_ns);
        return;
    case FS_OVERFLOW:
        finish_tx(p, ISOTP_BUFFER_OVFLW, t_ns);
        return;
    default:
        finish_tx(p, ISOTP_INVALID_FS, t_ns);
    }
}

/* ---- receiving ---- */

static void drop_rx(struct isotp *p)
{
    p->rx.state = ISOTP_RX_IDLE;
    sched_cancel(p->sched, &p->rx.timer);
}

static void fail_rx(struct isotp *p, enum isotp_result r, int64_t t_ns)
{
    drop_rx(p);
    p->failed[r]++;
    p->io.received(p->io.ctx, r, NULL, 0, t_ns);
}

static void wait_rx(struct isotp *p, enum isotp_rx state, int64_t t_ns)
{
    p->rx.state = state;
    sched_at(p->sched, &p->rx.timer, t_ns + ISOTP_TIMEOUT_NS);
}

static void rx_due(void *ctx, int64_t t_ns)
{
    struct isotp *p = ctx;
    fail_rx(p, p->rx.state == ISOTP_RX_FLOW ? ISOTP_TIMEOUT_A : ISOTP_TIMEOUT_CR, t_ns);
}

static void send_flow(struct isotp *p, uint8_t status, int64_t t_ns)
{
    uint8_t frame[FRAME] = {(uint8_t)(PCI_FLOW << 4 | status), p->cfg.block_size, p->cfg.st_min};
    pad_frame(frame, FLOW_MIN);
    p->io.send(p->io.ctx, frame, t_ns);
}

static void ask_block(struct isotp *p, int64_t t_ns)
{
    p->rx.block_left = p->cfg.block_size;
    wait_rx(p, ISOTP_RX_FLOW, t_ns);
    send_flow(p, FS_CONTINUE, t_ns);
}

/* A message that begins: false while one of ours goes out; one that had begun ends. */
static bool begin_rx(struct isotp *p, int64_t t_ns)
{
    if (p->tx.state != ISOTP_TX_IDLE) {
        p->ignored++;
        return false;
    }
    if (p->rx.state != ISOTP_RX_IDLE) fail_rx(p, ISOTP_UNEXP_PDU, t_ns);
    return true;
}

const uint8_t *isotp_single(const uint8_t *data, size_t len, size_t *n)
{
    if (len == 0 || data[0] >> 4 != PCI_SINGLE) return NULL;
    *n = data[0] & 15u;
    return *n >= 1 && *n <= SINGLE_MAX && len >= *n + 1 ? data + 1 : NULL;
}

static void on_single(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns)
{
    size_t n;
    const uint8_t *payload = isotp_single(data, len, &n);
    if (!payload) {
        p->ignored++;
        return;
    }
    if (!begin_rx(p, t_ns)) return;
    memcpy(p->cfg.buffer, payload, n);
    p->io.received(p->io.ctx, ISOTP_OK, p->cfg.buffer, n, t_ns);
}

/* Length in 12 bits; in 32 when these are 0, for more than they hold (9.6.3). 0: a form that is ignored. */
static uint32_t first_length(const uint8_t *data, size_t len)
{
    if (len != FRAME) return 0;
    const uint32_t n = (data[0] & 15u) << 8 | data[1];
    const uint32_t far = (uint32_t)data[2] << 24 | (uint32_t)data[3] << 16 | (uint32_t)data[4] << 8 | data[5];
    if (n == 0) return far > ISOTP_MAX ? far : 0;
    return n > SINGLE_MAX ? n : 0;
}

static void on_first(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns)
{
    const uint32_t n = first_length(data, len);
    if (n == 0) {
        p->ignored++;
        return;
    }
    if (!begin_rx(p, t_ns)) return;
    if (n > p->cfg.size) {
        p->failed[ISOTP_BUFFER_OVFLW]++;
        send_flow(p, FS_OVERFLOW, t_ns);
        return;
    }
    p->rx.size = n;
    p->rx.at = FIRST_DATA;
    p->rx.sn = 1;
    memcpy(p->cfg.buffer, &data[2], FIRST_DATA);
    p->io.begun(p->io.ctx, t_ns);
    ask_block(p, t_ns);
}

static void on_consecutive(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns)
{
    const size_t left = p->rx.size - p->rx.at;
    const size_t n = left < CONSECUTIVE_MAX ? left : CONSECUTIVE_MAX;
    if (p->rx.state != ISOTP_RX_CONSECUTIVE || len < n + 1) {
        p->ignored++;
        return;
    }
    if ((data[0] & SN_MASK) != p->rx.sn) {
        fail_rx(p, ISOTP_WRONG_SN, t_ns);
        return;
    }
    memcpy(&p->cfg.buffer[p->rx.at], &data[1], n);
    p->rx.at += n;
    p->rx.sn = (p->rx.sn + 1) & SN_MASK;
    if (p->rx.at == p->rx.size) {
        drop_rx(p);
        p->io.received(p->io.ctx, ISOTP_OK, p->cfg.buffer, p->rx.size, t_ns);
    } else if (p->rx.block_left && --p->rx.block_left == 0) {
        ask_block(p, t_ns);
    } else {
        wait_rx(p, ISOTP_RX_CONSECUTIVE, t_ns);
    }
}

/* ---- frames ---- */

void isotp_frame(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns)
{
    static void (*const on[])(struct isotp * p, const uint8_t *data, size_t len, int64_t t_ns) = {
        [PCI_SINGLE] = on_single, [PCI_FIRST] = on_first, [PCI_CONSECUTIVE] = on_consecutive, [PCI_FLOW] = on_flow};
    if (len == 0 || data[0] >> 4 > PCI_FLOW) p->ignored++;
    else on[data[0] >> 4](p, data, len, t_ns);
}

/* A frame that is not the last one is of a message that has been given up. */
static bool is_awaited(const struct isotp *p, const uint8_t *data, size_t len)
{
    const enum isotp_tx s = p->tx.state;
    const bool sending = s == ISOTP_TX_SINGLE || s == ISOTP_TX_FIRST || s == ISOTP_TX_CONSECUTIVE;
    return sending && len == FRAME && memcmp(data, p->tx.frame, FRAME) == 0;
}

void isotp_sent(struct isotp *p, const uint8_t *data, size_t len, int64_t t_ns)
{
    if (len > 0 && data[0] >> 4 == PCI_FLOW) {
        if (p->rx.state == ISOTP_RX_FLOW) wait_rx(p, ISOTP_RX_CONSECUTIVE, t_ns);
        return;
    }
    if (!is_awaited(p, data, len)) return;
    if (p->tx.state == ISOTP_TX_SINGLE) finish_tx(p, ISOTP_OK, t_ns);
    else if (p->tx.state == ISOTP_TX_FIRST) wait_tx(p, ISOTP_TX_FLOW, ISOTP_TIMEOUT_NS, t_ns);
    else consecutive_sent(p, t_ns);
}

/* ---- life ---- */

void isotp_init(struct isotp *p, const struct isotp_cfg *cfg, const struct isotp_io *io, struct sched *sched)
{
    assert(cfg->size >= SINGLE_MAX && cfg->size <= ISOTP_MAX);
    *p = (struct isotp){.cfg = *cfg, .io = *io, .sched = sched};
    sched_ev(&p->tx.timer, tx_due, p);
    sched_ev(&p->rx.timer, rx_due, p);
}

void isotp_reset(struct isotp *p)
{
    p->tx.state = ISOTP_TX_IDLE;
    sched_cancel(p->sched, &p->tx.timer);
    drop_rx(p);
}
