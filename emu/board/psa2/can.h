/* A PSA-2 unit on CAN: ties a board to a CANopen-shaped node (docs/reference/protocol.md; the mapping is ours, E0).
 *
 * The board's frames become PDOs of the chosen frame form, queued when INT rises; SDO reaches every register through the
 * controller KPSA. A form or data rate whose worst-case time on the wire does not fit the bus is refused in words: SDO
 * abort 08000022h, EMCY FF03h and the sentence in object 2031h. Owned by the caller, never moved after init, one thread,
 * no allocation. Use:
 *
 *     struct psa2_can_port port = psa2_can_port(&board);
 *     psa2_can_init(&can, &(struct board_can_cfg){.name = "a", .node_id = 5}, &port, &bus, &sched);
 *     psa2_attach(&board, &(struct psa2_host){&can, psa2_can_frame, psa2_can_fault});
 *     psa2_can_power_up(&can, t_ns);
 *
 * On a bench psa2/board.c does it. */
#ifndef PSABENCH_BOARD_PSA2_CAN_H
#define PSABENCH_BOARD_PSA2_CAN_H

#include "base/can.h"
#include "board/can.h"
#include "board/can_load.h"
#include "board/psa2/psa2.h"
#include "canopen/co_node.h"
#include "gen/psa2_od.h"

#define PSA2_CAN_TEXT    200u /* characters of the refusal, object 2031h */
#define PSA2_CAN_REMARK  64u
#define PSA2_CAN_CALM_NS NS_PER_S /* without a loss: the condition CAN overrun ends */

/* What the board is now. */
struct psa2_can_info {
    struct psa2_counters counters;
    int64_t period_ns; /* between frames as the converters are set; 0: unknown yet */
    uint32_t fclk_hz;  /* of the accelerometer converters */
    uint32_t serial;
    unsigned word_bits;
};

/* The board as this module needs it; tests put a fake here. */
struct psa2_can_port {
    void *ctx;
    enum psa2_result (*submit)(void *ctx, struct psa2_request *r, int64_t t_ns);
    void (*reset)(void *ctx, int64_t t_ns);
    void (*info)(void *ctx, struct psa2_can_info *out);
};

/* What the host can set (objects 2020h.. and 2040h, 2210h, 2211h). */
struct psa2_can_settings {
    uint8_t form;        /* enum psa2_form */
    uint8_t sample_mode; /* 0 free run, 1 on SYNC, 2 every N-th */
    uint16_t nth;
    bool sync_pin;
    float zero_v[3], scale_v_per_g[3];
};

/* Read-only outside board/psa2_can*.c. */
struct psa2_can {
    struct board_can_cfg cfg;
    struct psa2_can_port port;
    struct can_bus *bus;
    struct co_node node;
    struct psa2_can_settings set;
    struct psa2_frame latest;
    /* stream */
    int64_t checked_period_ns; /* period for which fits holds */
    bool fits;                 /* false: the stream stops, EMCY FF03h is active */
    bool sync_armed;
    int64_t sync_ns;
    struct can_msg block; /* being filled */
    unsigned block_samples;
    uint32_t dropped;
    int64_t drop_ns; /* last */
    /* controller's serial port */
    struct psa2_request request, pulse;
    bool request_busy, pulse_busy;
    uint8_t request_axis; /* whose answer is requested */
    uint32_t ticket, syncs_missed;
    /* text objects, load mark */
    char refusal[PSA2_CAN_TEXT], remark[PSA2_CAN_REMARK + 1];
    struct can_load_mark load;
};

struct psa2_can_port psa2_can_port(struct psa2 *b);

void psa2_can_init(struct psa2_can *c, const struct board_can_cfg *cfg, const struct psa2_can_port *port,
                   struct can_bus *bus, struct sched *s);

/* Attaches to the bus and boots; the board is powered up by its owner. */
void psa2_can_power_up(struct psa2_can *c, int64_t t_ns);
void psa2_can_power_down(struct psa2_can *c); /* leaves the bus and forgets everything but the counters */

/* Callbacks of the board: ctx is the struct psa2_can. */
void psa2_can_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns);
void psa2_can_fault(void *ctx, uint16_t code, int64_t t_ns);

#endif
