/* Ring capture of lines: keeps the latest edges in a bounded ring until a trigger comes, then writes a VCD file with what
 * was before it (pre-trigger) and after it (post-trigger).
 *
 * A trace sink. The trigger is an edge or a level of a line, found here at its exact instant, or whatever the owner makes
 * capture_trigger() of: a fault, an event of a board. The ring holds edges that have been delivered, so a trigger "now" comes
 * before the edges around it are in. Nothing is written from within a callback: the owner calls capture_drain() after time has
 * moved. After the trigger the ring is a queue to the file, so a long post-trigger needs no more memory. A ring that is too
 * small for the pre-trigger makes that shorter (from_ns); one that is too small between two calls of capture_drain() loses
 * edges, which are counted. No allocation: ring and copy are the owner's. One thread. */
#ifndef PSABENCH_TRACE_CAPTURE_H
#define PSABENCH_TRACE_CAPTURE_H

#include "trace/trace.h"
#include "trace/vcd.h"

enum capture_when { CAPTURE_OUTSIDE, CAPTURE_RISING, CAPTURE_FALLING, CAPTURE_EDGE, CAPTURE_HIGH, CAPTURE_LOW };

enum capture_state {
    CAPTURE_OFF,
    CAPTURE_ARMED,
    CAPTURE_TRIGGERED, /* no file yet: capture_begin() */
    CAPTURE_WRITING,
    CAPTURE_FULL /* the file has all that it is to have: capture_end() */
};

struct capture_cfg {
    int64_t pre_ns, post_ns;
    uint64_t mask;           /* lines recorded */
    unsigned sig;            /* line of the trigger */
    enum capture_when when;  /* CAPTURE_OUTSIDE: no line, the owner triggers */
    struct trace_step *ring; /* the owner's while it is armed, as the copy */
    unsigned steps_max;
    struct trace *copy; /* room for the lines of the file */
};

struct capture { /* read-only outside capture.c */
    struct trace_sink sink;
    struct trace *trace;
    struct capture_cfg cfg;
    enum capture_state state;
    unsigned head, count; /* oldest step of cfg.ring, steps */
    uint64_t level;       /* of all lines behind the newest step */
    uint64_t base;        /* before the oldest */
    int64_t base_ns;      /* the ring knows every change after this */
    int64_t trigger_ns;   /* instant of the trigger */
    int64_t from_ns;      /* where the file begins: trigger_ns - pre_ns, or later when the ring was too small */
    int64_t end_ns;
    uint64_t lost;     /* edges that found no room while a file was written */
    uint64_t triggers; /* since armed, those that came during another capture included */
    struct vcd vcd;
};

/* Attaches to the trace; a level that is there already is a trigger at once. */
void capture_arm(struct capture *c, struct trace *t, const struct capture_cfg *cfg);

/* From outside; has no effect but on the count where a capture is under way. */
void capture_trigger(struct capture *c, int64_t t_ns);

/* After a trigger: what the ring has of the pre-trigger goes into the file. cfg: from_ns and mask are the capture's. */
void capture_begin(struct capture *c, const struct vcd_cfg *cfg);

/* What has been delivered since goes into the file; CAPTURE_FULL when that is all. */
void capture_drain(struct capture *c);

/* The file ends: at end_ns, or where it is. Armed again, for the next trigger. */
void capture_end(struct capture *c);

void capture_off(struct capture *c); /* detaches; harmless when off */

#endif
