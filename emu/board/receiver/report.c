#include "board/receiver/report.h"

#include "base/detmath.h"

#include <math.h>
#include <stdio.h>

#define MS_A_DAY       INT64_C(86400000)
#define MS_A_WEEK      (7 * MS_A_DAY)
#define GPS_EPOCH_MS   (3657 * MS_A_DAY) /* 1980-01-06: IS-GPS-200, 20.3.3.5.2.4 */
#define DAYS_400_YEARS 146097
#define DAYS_TO_1970   719468 /* from 0000-03-01 */
#define FIRST_YEAR     1980
#define LAST_YEAR      2099

static int64_t floor_div(int64_t a, int64_t b)
{
    return a / b - (a % b < 0);
}

/* Years that begin in March: February, with its leap day, ends them. */
static int64_t days_of(int year, unsigned month, unsigned day)
{
    const int64_t y = year - (month <= 2);
    const int64_t era = floor_div(y, 400), of_era = y - era * 400;
    const int64_t of_year = (153 * ((int64_t)month + (month > 2 ? -3 : 9)) + 2) / 5 + (int64_t)day - 1;
    return era * DAYS_400_YEARS + of_era * 365 + of_era / 4 - of_era / 100 + of_year - DAYS_TO_1970;
}

static void date_of(int64_t days, struct calendar *c)
{
    const int64_t from = days + DAYS_TO_1970;
    const int64_t era = floor_div(from, DAYS_400_YEARS), of_era = from - era * DAYS_400_YEARS;
    const int64_t year = (of_era - of_era / 1460 + of_era / 36524 - of_era / 146096) / 365;
    const int64_t of_year = of_era - (365 * year + year / 4 - year / 100);
    const int64_t march = (5 * of_year + 2) / 153;
    c->day = (unsigned)(of_year - (153 * march + 2) / 5 + 1);
    c->month = (unsigned)(march < 10 ? march + 3 : march - 9);
    c->year = (int)(year + era * 400 + (c->month <= 2));
}

struct calendar calendar_of(int64_t utc_ms)
{
    struct calendar c;
    const int64_t days = floor_div(utc_ms, MS_A_DAY);
    const int64_t ms = utc_ms - days * MS_A_DAY;
    date_of(days, &c);
    c.hour = (unsigned)(ms / 3600000);
    c.minute = (unsigned)(ms / 60000 % 60);
    c.second = (unsigned)(ms / 1000 % 60);
    c.ms = (unsigned)(ms % 1000);
    return c;
}

int64_t calendar_utc_ms(const struct calendar *c)
{
    const int64_t days = days_of(c->year, c->month, c->day);
    return days * MS_A_DAY + ((int64_t)(c->hour * 60 + c->minute) * 60 + c->second) * 1000 + c->ms;
}

/* What reads as a date that there is not, 30 February or 25 o'clock, does not come back as it was. */
bool calendar_parse(const char *text, int64_t *utc_ms)
{
    struct calendar c = {.ms = 0};
    char back[32];
    int end = 0;
    if (sscanf(text, "%4d-%2u-%2uT%2u:%2u:%2u%n", &c.year, &c.month, &c.day, &c.hour, &c.minute, &c.second, &end) != 6)
        return false;
    if (text[end] || c.year < FIRST_YEAR || c.year > LAST_YEAR || c.month < 1 || c.month > 12) return false;
    const int64_t ms = calendar_utc_ms(&c);
    c = calendar_of(ms);
    (void)snprintf(back, sizeof back, "%04d-%02u-%02uT%02u:%02u:%02u", c.year % 10000, c.month % 100, c.day % 100,
                   c.hour % 100, c.minute % 100, c.second % 100);
    for (unsigned i = 0; back[i] || text[i]; i++)
        if (back[i] != text[i]) return false;
    if (ms < GPS_EPOCH_MS) return false;
    *utc_ms = ms;
    return true;
}

void report_gps_time(const struct report *r, uint32_t *week, uint32_t *tow_ms)
{
    const int64_t gps_ms = r->utc_ms - GPS_EPOCH_MS + (int64_t)r->leap_s * 1000;
    const int64_t weeks = floor_div(gps_ms, MS_A_WEEK);
    *week = (uint32_t)weeks;
    *tow_ms = (uint32_t)(gps_ms - weeks * MS_A_WEEK);
}

uint32_t report_speed_mmps(const struct report *r)
{
    const double east = r->v_n_mmps[0], north = r->v_n_mmps[1];
    return (uint32_t)(sqrt(east * east + north * north) + 0.5);
}

uint32_t report_course_e5(const struct report *r)
{
    const double rad = det_atan2(r->v_n_mmps[0], r->v_n_mmps[1]);
    const int32_t e5 = (int32_t)floor((rad < 0.0 ? rad + TURN_RAD : rad) / RAD_PER_DEG * 1e5 + 0.5);
    return (uint32_t)(e5 % 36000000);
}

uint32_t report_pdop_e2(const struct report *r)
{
    const double h = r->hdop_e2, v = r->vdop_e2;
    return (uint32_t)(sqrt(h * h + v * v) + 0.5);
}
