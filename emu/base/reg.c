#include "base/reg.h"

#include "base/bits.h"

#include <assert.h>

static bool is_hole(const struct reg_file *f, unsigned addr)
{
    return addr >= f->count || !f->map[addr].name;
}

void reg_reset(struct reg_file *f)
{
    for (unsigned a = 0; a < f->count; a++) f->value[a] = f->map[a].reset;
}

uint8_t reg_read(struct reg_file *f, unsigned addr)
{
    if (!is_hole(f, addr)) return f->value[addr];
    f->bad_access++;
    return 0;
}

void reg_write(struct reg_file *f, unsigned addr, uint8_t v, int64_t t_ns)
{
    if (is_hole(f, addr)) {
        f->bad_access++;
        return;
    }
    const struct reg_spec *r = &f->map[addr];
    const uint8_t was = f->value[addr];
    if ((v ^ was) & ~(unsigned)r->rw & 0xFFu) f->ro_write++;
    if (v & r->unimp) f->unimp_access++;
    f->value[addr] = (uint8_t)((was & ~(unsigned)r->rw) | (v & r->rw));
    if (r->on_write) r->on_write(f->chip, was, f->value[addr], t_ns);
}

uint8_t reg_peek(const struct reg_file *f, unsigned addr)
{
    return is_hole(f, addr) ? 0 : f->value[addr];
}

void reg_poke(struct reg_file *f, unsigned addr, uint8_t v)
{
    assert(!is_hole(f, addr));
    f->value[addr] = v;
}

uint32_t reg_peek24(const struct reg_file *f, unsigned addr)
{
    return (uint32_t)bits_get_le(&f->value[addr], 3);
}

void reg_poke24(struct reg_file *f, unsigned addr, uint32_t v)
{
    bits_put_le(&f->value[addr], v, 3);
}

bool reg_flip(struct reg_file *f, unsigned addr, uint8_t mask, int64_t t_ns)
{
    if (is_hole(f, addr)) return false;
    const struct reg_spec *r = &f->map[addr];
    const uint8_t was = f->value[addr];
    f->value[addr] = was ^ mask;
    if (r->on_write) r->on_write(f->chip, was, f->value[addr], t_ns);
    return true;
}
