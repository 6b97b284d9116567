#include "base/can/bits.h"

enum {
    STUFF_RUN = 5,      /* so many equal bits are followed by a bit of the other level */
    CRC15_POLY = 0x4599 /* ISO 11898-1, classic frames */
};

/* CRC delimiter, ACK slot, ACK delimiter, 7 bits end of frame, interframe space: never stuffed. */
#define TAIL_BITS (1u + 1u + 1u + 7u + CAN_IFS_BITS)

/* The sender's bit stream between start of frame and CRC. By value: the two chains of look-ups live in registers. */
struct stream {
    unsigned bits; /* sent so far, stuff bits included */
    unsigned row;  /* 2 (run - 1) + level: equal bits up to now, and theirs */
    uint32_t crc;  /* over the unstuffed bits; above its 15 bits is what has been shifted out */
};

/* Before the last bit of an idle bus. With it the start of a classic frame is whole fours of bits; it is not counted, start of
 * frame ends its run, and it leaves a CRC of zero. */
static const struct stream idle = {.bits = 0u - 1u, .row = 0, .crc = 0x4000};

/* A stuff bit is due before the next bit, so that a frame form may drop the one after its last bit. */
static inline struct stream put_bit(struct stream s, unsigned bit)
{
    const unsigned due = s.row >= 2 * (STUFF_RUN - 1);
    const unsigned before = due ? (s.row & 1u) ^ 1u : s.row;
    s.row = (before & 1u) == bit ? before + 2 : bit;
    s.bits += 1 + due;
    const uint32_t differs = 0u - ((s.crc >> 14 ^ bit) & 1u);
    s.crc = s.crc << 1 ^ (differs & CRC15_POLY);
    return s;
}

/* Four bits at once, what put_bit() does four times over. Entry: the row after, and bit 7 if a stuff bit has come, never two. */
static const uint8_t after_four[2 * STUFF_RUN][16] = {
    // clang-format off
    {0x08, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x05, 0x04, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x07},
    {0x06, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x05, 0x04, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x09},
    {0x80, 0x83, 0x00, 0x03, 0x02, 0x01, 0x00, 0x05, 0x04, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x07},
    {0x06, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x05, 0x04, 0x01, 0x00, 0x03, 0x02, 0x01, 0x82, 0x81},
    {0x82, 0x81, 0x80, 0x85, 0x02, 0x01, 0x00, 0x05, 0x04, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x07},
    {0x06, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x05, 0x04, 0x01, 0x00, 0x03, 0x84, 0x81, 0x80, 0x83},
    {0x84, 0x81, 0x80, 0x83, 0x82, 0x81, 0x80, 0x87, 0x04, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x07},
    {0x06, 0x01, 0x00, 0x03, 0x02, 0x01, 0x00, 0x05, 0x86, 0x81, 0x80, 0x83, 0x82, 0x81, 0x80, 0x85},
    {0x86, 0x81, 0x80, 0x83, 0x82, 0x81, 0x80, 0x85, 0x84, 0x81, 0x80, 0x83, 0x82, 0x81, 0x80, 0x89},
    {0x88, 0x81, 0x80, 0x83, 0x82, 0x81, 0x80, 0x85, 0x84, 0x81, 0x80, 0x83, 0x82, 0x81, 0x80, 0x87},
    // clang-format on
};
/* The CRC of four bits that are the first of 15. */
static const uint16_t crc_of[16] = {0x0000, 0x4599, 0x4EAB, 0x0B32, 0x58CF, 0x1D56, 0x1664, 0x53FD,
                                    0x7407, 0x319E, 0x3AAC, 0x7F35, 0x2CC8, 0x6951, 0x6263, 0x27FA};

static inline struct stream put_four(struct stream s, unsigned four)
{
    const unsigned after = after_four[s.row][four];
    s.bits += 4 + (after >> 7);
    s.row = after & 15u;
    s.crc = s.crc << 4 ^ crc_of[(s.crc >> 11 ^ four) & 15u];
    return s;
}

static inline struct stream put_bits(struct stream s, uint64_t value, unsigned bits)
{
    for (; bits % 4 != 0; bits--) s = put_bit(s, (unsigned)(value >> (bits - 1)) & 1u);
    for (; bits > 0; bits -= 4) s = put_four(s, (unsigned)(value >> (bits - 4)) & 15u);
    return s;
}

static inline struct stream put_data(struct stream s, const struct can_msg *m)
{
    for (unsigned i = 0; i < m->len; i++) s = put_four(put_four(s, m->data[i] >> 4), m->data[i] & 15u);
    return s;
}

/* Idle bus and start of frame, arbitration up to RTR or IDE (base identifier, or base, SRR, IDE and extension), `bits` more. */
static inline struct stream put_head(const struct can_msg *m, unsigned more, unsigned bits)
{
    const unsigned rtr = m->flags & CAN_RTR ? 1 : 0;
    if (!(m->flags & CAN_EXT)) return put_bits(idle, (2u << 13 | m->id << 2 | rtr << 1) << bits | more, 15 + bits);
    const uint64_t id = (m->id >> 18) << 21 | 3u << 19 | (m->id & 0x3FFFFu) << 1 | rtr;
    return put_bits(idle, (UINT64_C(2) << 32 | id) << bits | more, 34 + bits);
}

static struct can_bits classic_bits(const struct can_msg *m)
{
    const unsigned reserved = m->flags & CAN_EXT ? 2 : 1; /* r1, r0 */
    struct stream s = put_head(m, can_dlc(m->len), reserved + 4);
    if (!(m->flags & CAN_RTR)) s = put_data(s, m);
    s = put_bits(s, (s.crc & 0x7FFFu) << 1 | 1u, 16); /* with its delimiter, and the stuff bit between them */
    return (struct can_bits){s.bits - 1 + TAIL_BITS, 0};
}

/* Stuff count (3 bits Gray code and parity), CRC, and a fixed stuff bit before the first and after every fourth of them. */
static unsigned fd_crc_bits(unsigned len)
{
    const unsigned bits = 4u + (len > 16u ? 21u : 17u);
    return bits + (bits + 3u) / 4u;
}

static struct can_bits fd_bits(const struct can_msg *m)
{
    const unsigned brs = m->flags & CAN_BRS ? 1 : 0;
    struct stream s = put_head(m, 4 | brs, 3); /* FDF, res, BRS */
    const unsigned arbitration = s.bits;
    s = put_data(put_bits(s, can_dlc(m->len), 5), m); /* ESI 0 */
    /* No stuff bit after the last data bit: the fixed one is there. */
    const unsigned fast = s.bits - arbitration + fd_crc_bits(m->len);
    return brs ? (struct can_bits){arbitration + TAIL_BITS, fast}
               : (struct can_bits){arbitration + fast + TAIL_BITS, 0};
}

struct can_bits can_bits_exact(const struct can_msg *m)
{
    return m->flags & CAN_FD ? fd_bits(m) : classic_bits(m);
}

/* At most one stuff bit after the first five bits and one after every four that follow. */
static unsigned most_stuff(unsigned bits)
{
    return (bits - 1u) / 4u;
}

struct can_bits can_bits_worst(uint8_t flags, uint8_t len)
{
    const unsigned id = flags & CAN_EXT ? 33u : 14u; /* SOF .. IDE, or .. RTR of an extended frame */
    const unsigned data = flags & CAN_RTR ? 0u : 8u * len;
    if (!(flags & CAN_FD)) {
        const unsigned bits = id + (flags & CAN_EXT ? 2u : 1u) + 4u + data + 15u;
        return (struct can_bits){bits + most_stuff(bits) + TAIL_BITS, 0};
    }
    const unsigned arbitration = id + 3u;
    const unsigned dynamic = arbitration + 5u + data;
    const unsigned stuff_nominal = most_stuff(arbitration);
    const unsigned nominal = arbitration + stuff_nominal + TAIL_BITS;
    const unsigned fast = dynamic - arbitration + most_stuff(dynamic) - stuff_nominal + fd_crc_bits(len);
    return flags & CAN_BRS ? (struct can_bits){nominal, fast} : (struct can_bits){nominal + fast, 0};
}

static int64_t bits_ns(unsigned bits, uint32_t hz)
{
    return bits != 0 && hz != 0 ? ((int64_t)bits * NS_PER_S + hz / 2) / hz : 0;
}

int64_t can_bits_ns(struct can_bits n, const struct can_bus_cfg *cfg)
{
    if (cfg->bitrate_hz == 0) return 0;
    return bits_ns(n.nominal, cfg->bitrate_hz) + bits_ns(n.data, cfg->data_bitrate_hz);
}

uint8_t can_dlc(uint8_t len)
{
    static const uint8_t step[] = {12, 16, 20, 24, 32, 48, 64};
    if (len <= 8) return len;
    for (unsigned i = 0; i < sizeof step; i++) {
        if (len <= step[i]) return (uint8_t)(9 + i);
    }
    return 15;
}
