/* Events of a PSA-2 board, notified at their instants, and the faults of its controller: included by board/psa2/psa2.h. */
#ifndef PSABENCH_BOARD_PSA2_EVENT_H
#define PSABENCH_BOARD_PSA2_EVENT_H

#include "board/part.h"

#define PSA2_EVENT_LIST(X)                                                                                             \
    X(PSA2, RES)        /* Res falls */                                                                                \
    X(PSA2, SETUP_DONE) /* the set-up has been carried out */                                                          \
    X(PSA2, SYNC_A)     /* SYNC_A rises: the converters synchronise */                                                 \
    X(PSA2, SYNC_T)     /* SYNC_T rises again: the converter synchronises */                                           \
    X(PSA2, DRD_A)      /* DRD_A falls */                                                                              \
    X(PSA2, DRD_T)      /* DRD_T falls */                                                                              \
    X(PSA2, INT_FALL)   /* a frame begins on the output line */                                                        \
    X(PSA2, INT_RISE)   /* it has been sent whole */                                                                   \
    X(PSA2, POWER_DOWN)                                                                                                \
    X(PSA2, POWER_UP)
enum psa2_event { PSA2_EVENT_LIST(BOARD_EVENT) PSA2_EVENTS };

extern const char *const psa2_events[PSA2_EVENTS];

/* Faults of the controller: bits of board.faults. */
enum psa2_controller_fault {
    PSA2_FAULT_SKIP_SYNC_T = 1, /* never a pulse on SYNC_T: temperature words come every data period, settled or not */
    PSA2_FAULT_SETUP_ORDER = 2, /* the set-up's steps of each data-ready event in reverse order; from the next Res on */
    PSA2_FAULT_FROZEN_WORDS = 4 /* the codes of the frame before, over and over; number and time go on */
};

#endif
