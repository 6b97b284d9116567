/* Lines, events and registers of a PSD-1: included by board/psd1/psd1.h. */
#ifndef PSABENCH_BOARD_PSD1_NAMES_H
#define PSABENCH_BOARD_PSD1_NAMES_H

#include "board/part.h"

/* Number in the board's trace. */
enum psd1_line {
    PSD1_LINE_A0,
    PSD1_LINE_INT0,
    PSD1_LINE_FL1,
    PSD1_LINE_FL2,
    PSD1_LINE_DR,
    PSD1_LINE_RFX,
    PSD1_LINE_RFY,
    PSD1_LINE_RFZ,
    PSD1_LINE_TFS,
    PSD1_LINE_SCLK,
    PSD1_LINE_SDAT,
    PSD1_LINE_CLK,
    PSD1_LINE_CS,
    PSD1_LINE_RW,
    PSD1_LINE_AB0,
    PSD1_LINE_D0 = PSD1_LINE_AB0 + 4,
    PSD1_LINES = PSD1_LINE_D0 + 16
};

#define PSD1_EVENT_LIST(X)                                                                                             \
    X(PSD1, RES)                                                                                                       \
    X(PSD1, SETUP_DONE)                                                                                                \
    X(PSD1, DR)  /* DR falls */                                                                                        \
    X(PSD1, A0)  /* a cycle begins */                                                                                  \
    X(PSD1, RFX) /* RFx falls */                                                                                       \
    X(PSD1, RFY)                                                                                                       \
    X(PSD1, RFZ)                                                                                                       \
    X(PSD1, FL2)    /* a word waits */                                                                                 \
    X(PSD1, STROBE) /* it begins to be read */                                                                         \
    X(PSD1, CYCLE)  /* the third word has been read: the last FL2 is over */                                           \
    X(PSD1, UC)     /* TFS falls: a control word is sent */                                                            \
    X(PSD1, POWER_DOWN)                                                                                                \
    X(PSD1, POWER_UP)
enum psd1_event { PSD1_EVENT_LIST(BOARD_EVENT) PSD1_EVENTS };

/* Addresses A3..A0. */
enum psd1_register {
    PSD1_REG_X,
    PSD1_REG_Y,
    PSD1_REG_Z,
    PSD1_REG_STATUS,
    PSD1_REG_GYRO_X,
    PSD1_REG_RATE_X = PSD1_REG_GYRO_X + 3,
    PSD1_REG_TEMP = PSD1_REG_RATE_X + 3,
    PSD1_REG_SERVICE,
    PSD1_REG_UC_HIGH,
    PSD1_REG_UC_LOW,
    PSD1_REG_COMMAND,
    PSD1_REG_FLAGS,
    PSD1_REGS
};

/* Register STATUS. */
enum psd1_status {
    PSD1_ST_FL2 = 0x0001,     /* a word waits, of the axis in bits 1..2 (0 X, 1 Y, 2 Z) */
    PSD1_ST_CYCLE = 0x0008,   /* a cycle is under way */
    PSD1_ST_INT0 = 0x0010,    /* INT0 is active */
    PSD1_ST_FL1 = 0x0020,     /* FL1 is active */
    PSD1_ST_DR = 0x0040,      /* DR is active */
    PSD1_ST_READY = 0x0080,   /* the set-up has been carried out */
    PSD1_ST_COMMAND = 0x0100, /* a command is under way or waits */
    PSD1_ST_COEF = 0x0200,    /* coefficients have been read since power-up */
    PSD1_ST_OVERRUN = 0x0400, /* of the latest cycle, as in its status */
    PSD1_ST_LATE = 0x0800
};

extern const struct board_line psd1_lines[PSD1_LINES]; /* at rest, FL2 active high */
extern const char *const psd1_events[PSD1_EVENTS];

#endif
