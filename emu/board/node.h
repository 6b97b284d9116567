/* A board's unit on CAN, as all boards have it (docs/reference/protocol_<board>.md): ties a board to a CANopen-shaped node.
 *
 * What every unit has is answered here: identity, counters (2030h, the board's own from board_part[0]), the parallel bus
 * as objects (2002h: sub-index = address + 1, answered when the cycle is done; strobe length 2051h), the reason of the last
 * rejection (2031h), a remark (2040h); the stream is checked against the bus before it flows. The rest of proto/<board>.yaml a
 * board answers by a table of handlers. Owned by the caller, never moved after init, one thread, no allocation. A board's
 * can.c, in the order of proto/<board>.yaml:
 *
 *     struct psd1_can { struct board_node node; ...settings of its own... };     // the node first
 *     static const struct board_object objects[] = {{PSD1_OD_CODES, .value = read_code}, ...};
 *     static const struct board_node_type type = {.device = &psd1_device, BOARD_NODE_OBJECTS(objects),
 *                                                 .period_ns = period_of};
 *     const struct board_can psd1_can = {.size = sizeof(struct psd1_can), .init = init, BOARD_NODE_LIFE};
 *     static void init(void *can, const struct board_can_cfg *cfg, void *board, struct can_bus *bus, struct sched *s)
 *     {   board_node_init(can, &type, cfg, board, bus, s);  ((struct psd1 *)board)->host = (struct psd1_host){...}; }
 *
 * and when a reading is complete board_node_stream(&can->node, PSD1_CYCLE_TPDO, m, 1, t_ns).                         */
#ifndef PSABENCH_BOARD_NODE_H
#define PSABENCH_BOARD_NODE_H

#include "board/board.h"
#include "canopen/co_device.h"
#include "canopen/co_node.h"

#define BOARD_NODE_TEXT    200u     /* characters of object 2031h */
#define BOARD_NODE_REMARK  64u      /* of object 2040h */
#define BOARD_NODE_CALM_NS NS_PER_S /* without a loss: the condition CAN overrun ends */

struct board_node;

/* Which functions answer for an object, all its sub-indices; NULL: cannot. Rights, type and limits of the entry have been
 * checked. CO_OK, an abort code, or CO_PENDING: then co_node_answer() with the ticket node.sdo.ticket had. */
struct board_object {
    uint16_t index;
    double (*value)(const struct board_node *n, const struct co_entry *e); /* a number that is there */
    uint32_t (*read)(struct board_node *n, const struct co_entry *e, struct co_value *v,
                     int64_t t_ns); /* any other answer: a text, one that takes time */
    uint32_t (*write)(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns);
};

struct board_node_type {
    const struct co_device *device;
    const struct board_object *objects;
    unsigned object_count;
    /* Of the stream as it is set now; NULL: the board checks its stream itself and sets `fits`. */
    int64_t (*period_ns)(const void *board);
    /* After each event of the node: selects the TPDOs. NULL: all of the device, after a reset. */
    void (*restart)(struct board_node *n);
    void (*defaults)(struct board_node *n);              /* settings of its own, also at init; or NULL */
    void (*sync)(struct board_node *n, int64_t t_ns);    /* SYNC came; or NULL */
    void (*started)(struct board_node *n, int64_t t_ns); /* the node became operational; or NULL */
    void (*rx_other)(struct board_node *n, const struct can_msg *m,
                     int64_t t_ns); /* a frame of another node; or NULL */
};

/* Read-only outside board/node.c, but for what a board without period_ns does. */
struct board_node {
    const struct board_node_type *type;
    struct board_can_cfg cfg;
    void *board;
    struct can_bus *bus;
    struct co_node node;
    /* stream */
    int64_t fit_period_ns; /* `fits` holds for this period and these TPDOs */
    unsigned fit_tpdos;
    bool fits; /* false: the stream is stopped, EMCY FF03h is active */
    uint32_t readings, dropped;
    int64_t drop_ns; /* last */
    /* bus cycle under way */
    struct board_cycle cycle;
    bool cycle_busy;
    uint32_t ticket, cycles, cycles_refused;
    uint32_t strobe_ns;                 /* 2051h */
    int64_t load_from_ns, load_busy_ns; /* when the load of the bus was last read, and its busy time then */
    char refusal[BOARD_NODE_TEXT], remark[BOARD_NODE_REMARK + 1];
};

/* Asserts that the board has every counter of its device. */
void board_node_init(struct board_node *n, const struct board_node_type *type, const struct board_can_cfg *cfg,
                     void *board, struct can_bus *bus, struct sched *s);

#define BOARD_NODE_OBJECTS(table) .objects = (table), .object_count = sizeof(table) / sizeof *(table)

/* For struct board_can; can: a struct that begins with the node. */
#define BOARD_NODE_LIFE .power_up = board_node_power_up, .power_down = board_node_power_down, .node = board_node_co
void board_node_power_up(void *can, int64_t t_ns);
void board_node_power_down(void *can);
struct co_node *board_node_co(void *can);

/* A reading: m[i] (data and len) goes as TPDO first + i, all or none. Counted also where nothing is sent. */
void board_node_stream(struct board_node *n, unsigned first, struct can_msg *m, unsigned frames, int64_t t_ns);

/* A setting of the board was rejected: object 2031h has the reason. */
void board_node_reject(struct board_node *n, const char *why);

/* The bus cannot carry the stream, or can again: 2031h, EMCY FF03h; the bench is notified once. */
void board_node_reject_stream(struct board_node *n, const char *why, int64_t t_ns);
void board_node_accept_stream(struct board_node *n, int64_t t_ns);

/* Whether the bus can carry `frames` frames that take need_ns at worst (base/can/bits.h) and are due every have_ns; 0: whenever,
 * not judged. False with a sentence about `what` in why. */
bool board_node_load_fits(const struct can_bus_cfg *bus, const char *what, unsigned frames, int64_t need_ns,
                          int64_t have_ns, char why[BOARD_NODE_TEXT]);

/* Load of the bus in units of 0.1 % since it was last asked for. */
int64_t board_node_load(struct board_node *n, int64_t t_ns);

/* A condition of the board begins or ends: its EMCY. */
void board_node_condition(struct board_node *n, uint16_t code, uint8_t source, bool active, int64_t t_ns);

/* SDO abort code of a rejected cycle: sources can 3.3. */
uint32_t board_node_abort_of(enum board_cycle_result r);

/* Default of an entry as proto/<board>.yaml has it. */
double board_node_default(const struct board_node *n, uint16_t index, uint8_t sub);

#endif
