/* A host on a CAN bus: what it sends, and the time until it has been answered. */
#ifndef PSABENCH_TESTS_HOST_WIRE_H
#define PSABENCH_TESTS_HOST_WIRE_H

#include "rig.h"

#include "base/bits.h"
#include "base/can/can.h"
#include "canopen/co_node.h"

#include <string.h>

enum { HOST_SETTLE_NS = NS_PER_S / 200 };

static inline void host_put(struct can_bus *bus, struct can_node *host, uint32_t id, uint8_t len, const uint8_t *data)
{
    struct can_msg m = {.id = id, .len = len};
    if (data) memcpy(m.data, data, len);
    assert_int_equal(can_send(bus, host, &m, bus->sched->now_ns), CAN_OK);
}

static inline void host_settle(struct can_bus *bus)
{
    sched_run_until(bus->sched, bus->sched->now_ns + HOST_SETTLE_NS);
}

/* One SDO request with up to four bytes of data. */
static inline void host_asks(struct can_bus *bus, struct can_node *host, uint8_t node, uint8_t command, uint16_t index,
                             uint8_t sub, uint32_t data)
{
    uint8_t frame[8] = {command};
    bits_put_le(&frame[1], index, 2);
    frame[3] = sub;
    bits_put_le(&frame[4], data, 4);
    host_put(bus, host, 0x600u + node, sizeof frame, frame);
}

static inline bool error_active(const struct co_node *n, uint16_t code)
{
    for (unsigned i = 0; i < CO_ERRORS_MAX; i++)
        if (n->error[i].code == code) return true;
    return false;
}

#endif
