#include "board/receiver/nmea.h"

#include <assert.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define MINUTES_E5_A_DEG  6000000   /* 60 minutes of 1e-5 */
#define KNOT_UM           514444444 /* in 1e-9 m/s: 1852 m an hour */
#define COURSE_LEAST_MMPS 100u      /* below it the course is noise, and stays empty */

__attribute__((format(printf, 2, 3))) static void add_text(struct nmea *s, const char *format, ...)
{
    va_list ap;
    va_start(ap, format);
    const int n = vsnprintf(s->text + s->len, sizeof s->text - s->len, format, ap);
    va_end(ap);
    assert(n >= 0 && s->len + (unsigned)n < sizeof s->text);
    s->len += (unsigned)n;
}

static int64_t round_div(int64_t a, int64_t b)
{
    return a >= 0 ? (a + b / 2) / b : -((-a + b / 2) / b);
}

static int64_t limit_size(int64_t x, int64_t most)
{
    return x > most ? most : x < -most ? -most : x;
}

/* ",5545.12345,N", or two empty fields. From 1e-7 deg: x 60 / 100, rounded as a whole, so that minutes never read 60. */
static void add_angle(struct nmea *s, const struct report *r, int32_t e7, int width, const char *signs)
{
    if (r->fix == REPORT_NO_FIX) {
        add_text(s, ",,");
        return;
    }
    const int64_t e5 = round_div((int64_t)e7 * 3, 5), size = e5 < 0 ? -e5 : e5;
    add_text(s, ",%0*" PRId64 "%02" PRId64 ".%05" PRId64 ",%c", width, size / MINUTES_E5_A_DEG,
             size % MINUTES_E5_A_DEG / 100000, size % 100000, signs[e5 < 0]);
}

static void add_place(struct nmea *s, const struct report *r)
{
    add_angle(s, r, r->lat_e7, 2, "NS");
    add_angle(s, r, r->lon_e7, 3, "EW");
}

static void add_time(struct nmea *s, const struct calendar *c)
{
    add_text(s, ",%02u%02u%02u.%02u", c->hour, c->minute, c->second, c->ms / 10);
}

/* From millimetres; most: the most tenths of a metre, so that a sentence has its length. */
static void add_metres(struct nmea *s, int64_t mm, int64_t most_dm)
{
    const int64_t dm = limit_size(round_div(mm, 100), most_dm), size = dm < 0 ? -dm : dm;
    add_text(s, ",%s%" PRId64 ".%" PRId64 ",M", dm < 0 ? "-" : "", size / 10, size % 10);
}

static void add_course(struct nmea *s, const struct report *r)
{
    if (r->fix == REPORT_NO_FIX || report_speed_mmps(r) < COURSE_LEAST_MMPS) {
        add_text(s, ",");
        return;
    }
    const uint32_t e2 = (report_course_e5(r) + 500) / 1000 % 36000;
    add_text(s, ",%" PRIu32 ".%02" PRIu32, e2 / 100, e2 % 100);
}

static void add_knots(struct nmea *s, const struct report *r)
{
    const int64_t e3 = limit_size(round_div((int64_t)report_speed_mmps(r) * 1000000000, KNOT_UM), 99999999);
    add_text(s, ",%" PRId64 ".%03" PRId64, e3 / 1000, e3 % 1000);
}

/* ---- sentences */

static void write_gga(struct nmea *s, const struct report *r)
{
    const struct calendar c = calendar_of(r->utc_ms);
    const bool fix = r->fix != REPORT_NO_FIX;
    add_time(s, &c);
    add_place(s, r);
    add_text(s, ",%d,%02u", fix, fix ? r->sats : 0);
    if (!fix) {
        add_text(s, ",99.99,,,,,,");
        return;
    }
    add_text(s, ",%u.%02u", r->hdop_e2 / 100, r->hdop_e2 % 100);
    add_metres(s, (int64_t)r->h_mm - r->geoid_mm, 999999);
    add_metres(s, r->geoid_mm, 9999);
    add_text(s, ",,");
}

static void add_dop(struct nmea *s, uint32_t e2)
{
    add_text(s, ",%" PRIu32 ".%02" PRIu32, e2 / 100, e2 % 100);
}

static void write_gsa(struct nmea *s, const struct report *r)
{
    const bool fix = r->fix != REPORT_NO_FIX;
    add_text(s, ",A,%d", fix ? 3 : 1);
    for (unsigned i = 1; i <= REPORT_SATS_MAX; i++) {
        if (fix && i <= r->sats) add_text(s, ",%02u", i);
        else add_text(s, ",");
    }
    add_dop(s, fix ? report_pdop_e2(r) : 9999);
    add_dop(s, fix ? r->hdop_e2 : 9999);
    add_dop(s, fix ? r->vdop_e2 : 9999);
}

static void write_rmc(struct nmea *s, const struct report *r)
{
    const struct calendar c = calendar_of(r->utc_ms);
    const bool fix = r->fix != REPORT_NO_FIX;
    add_time(s, &c);
    add_text(s, ",%c", fix ? 'A' : 'V');
    add_place(s, r);
    if (fix) add_knots(s, r);
    else add_text(s, ",");
    add_course(s, r);
    add_text(s, ",%02u%02u%02u,,,%c", c.day, c.month, (unsigned)c.year % 100, fix ? 'A' : 'N');
}

static void write_vtg(struct nmea *s, const struct report *r)
{
    if (r->fix == REPORT_NO_FIX) {
        add_text(s, ",,T,,M,,N,,K,N");
        return;
    }
    const int64_t kmph_e3 = limit_size(round_div((int64_t)report_speed_mmps(r) * 36, 10), 99999999);
    add_course(s, r);
    add_text(s, ",T,,M");
    add_knots(s, r);
    add_text(s, ",N,%" PRId64 ".%03" PRId64 ",K,A", kmph_e3 / 1000, kmph_e3 % 1000);
}

static void write_zda(struct nmea *s, const struct report *r)
{
    const struct calendar c = calendar_of(r->utc_ms);
    add_time(s, &c);
    add_text(s, ",%02u,%02u,%04d,00,00", c.day, c.month, c.year);
}

uint8_t nmea_checksum(const char *text, size_t len)
{
    uint8_t sum = 0;
    for (size_t i = 0; i < len; i++) sum ^= (uint8_t)text[i];
    return sum;
}

void nmea_write(const struct report *r, enum nmea_kind kind, struct nmea *out)
{
    static const struct {
        const char *name;
        void (*write)(struct nmea *s, const struct report *r);
    } kinds[NMEA_KINDS] = {[NMEA_GGA] = {"GGA", write_gga},
                           [NMEA_GSA] = {"GSA", write_gsa},
                           [NMEA_RMC] = {"RMC", write_rmc},
                           [NMEA_VTG] = {"VTG", write_vtg},
                           [NMEA_ZDA] = {"ZDA", write_zda}};
    out->len = 0;
    add_text(out, "$GP%s", kinds[kind].name);
    kinds[kind].write(out, r);
    add_text(out, "*%02X\r\n", nmea_checksum(out->text + 1, out->len - 1));
}
