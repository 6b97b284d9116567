/* A board's side of the CAN bus, as its unit knows it. */
#ifndef PSABENCH_BOARD_CAN_H
#define PSABENCH_BOARD_CAN_H

#include "base/can/can.h"
#include "base/sched.h"

#include <stddef.h>
#include <stdint.h>

struct board;
struct co_node;
struct board_type;
struct board_can_cfg {
    const char *name;                                              /* kept by pointer */
    const struct board_type *type;                                 /* of the board */
    uint8_t node_id;                                               /* 1..127 */
    void (*refused)(void *ctx, const char *name, const char *why); /* a setting was rejected, in words; may be NULL */
    void *ctx;
};
struct board_can {
    size_t size;
    /* Wires itself to the board's callbacks; the board has been initialised. */
    void (*init)(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus, struct sched *s);
    void (*power_up)(void *can, int64_t t_ns); /* after the board's */
    void (*power_down)(void *can);
    struct co_node *(*node)(void *can);
};

#endif
