/* The serial port of a board that has one: bytes out of the board at their bit rate. */
#ifndef PSABENCH_BOARD_SERIAL_H
#define PSABENCH_BOARD_SERIAL_H

#include <stddef.h>
#include <stdint.h>

struct board;

struct board_serial {
    uint32_t (*baud)(const struct board *b);
    void (*unfit)(const struct board *b, char *names,
                  size_t cap); /* messages that its bit rate does not carry; or "" */
    /* Each byte from now on, when its stop bit ends; NULL: to no one. */
    void (*connect)(struct board *b, void (*sent)(void *ctx, uint8_t byte, int64_t t_ns), void *ctx);
};

#endif
