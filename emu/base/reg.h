/* Register engine: what every chip's register file does, driven by the chip's table.
 *
 * The table is const and indexed by address, in datasheet order. Four ways in: reg_read and reg_write are the bus, with
 * rights and side effects; reg_peek has none (shell, trace, tests); reg_poke is the chip writing its own status. */
#ifndef PSABENCH_BASE_REG_H
#define PSABENCH_BASE_REG_H

#include <stdbool.h>
#include <stdint.h>

/* Called after a bus write has been stored; it only starts or stops things. */
typedef void reg_hook(void *chip, uint8_t was, uint8_t now, int64_t t_ns);

struct reg_spec {
    const char *name; /* NULL: hole in the map, the part has nothing here */
    const char *src;  /* where the row comes from: datasheet table, driver source, mark of certainty */
    uint8_t reset;
    uint8_t rw;    /* bits that a bus write stores; the rest keep their value */
    uint8_t unimp; /* bits the part has and this model does not: setting one is counted, our debt */
    reg_hook *on_write;
};

struct reg_file {
    const struct reg_spec *map;
    unsigned count;        /* addresses 0 .. count-1 */
    uint8_t *value;        /* count bytes, owned by the chip */
    void *chip;            /* handed to the hooks */
    uint32_t bad_access;   /* reads and writes of holes and beyond the map */
    uint32_t unimp_access; /* writes that set a bit we do not model */
    uint32_t ro_write;     /* writes that tried to change a read-only bit */
};

void reg_reset(struct reg_file *f);                  /* stores reset values, runs no hook; counters stay */
uint8_t reg_read(struct reg_file *f, unsigned addr); /* a hole reads 00 and is counted */
void reg_write(struct reg_file *f, unsigned addr, uint8_t v, int64_t t_ns);
uint8_t reg_peek(const struct reg_file *f, unsigned addr);
void reg_poke(struct reg_file *f, unsigned addr, uint8_t v);

/* Three registers in a row as one of 24 bits, lowest byte first: peek and poke. */
uint32_t reg_peek24(const struct reg_file *f, unsigned addr);
void reg_poke24(struct reg_file *f, unsigned addr, uint32_t v);

/* A fault inverts bits, read-only ones too; the hook runs, for the logic sees what is stored. False: a hole. */
bool reg_flip(struct reg_file *f, unsigned addr, uint8_t mask, int64_t t_ns);

#endif
