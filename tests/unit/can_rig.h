/* What the tests of both text codecs share: comparing and inventing frames. */
#ifndef PSABENCH_TESTS_CAN_RIG_H
#define PSABENCH_TESTS_CAN_RIG_H

#include "rig.h"

#include "base/can/can.h"
#include "base/rng.h"

/* Field by field: padding and the bytes behind len do not count. */
static inline void assert_same_frame(const struct can_msg *got, const struct can_msg *want)
{
    assert_int_equal(got->id, want->id);
    assert_int_equal(got->flags, want->flags);
    assert_int_equal(got->len, want->len);
    if (!(want->flags & CAN_RTR)) assert_memory_equal(got->data, want->data, want->len);
}

/* A valid frame with these flags. */
static inline struct can_msg random_frame(struct rng *r, uint8_t flags)
{
    static const uint8_t fd_len[] = {0, 1, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    struct can_msg m = {.flags = flags};
    m.id = (uint32_t)(rng_u64(r) & (flags & CAN_EXT ? 0x1FFFFFFF : 0x7FF));
    m.len = flags & CAN_FD ? fd_len[rng_u64(r) % sizeof fd_len] : (uint8_t)(rng_u64(r) % 9);
    for (unsigned i = 0; i < m.len && !(flags & CAN_RTR); i++) m.data[i] = (uint8_t)rng_u64(r);
    return m;
}

#endif
