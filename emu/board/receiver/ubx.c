#include "board/receiver/ubx.h"

#include <string.h>

enum { SYNC_1 = 0xB5, SYNC_2 = 0x62, CLASS_NAV = 0x01, ID_PVT = 0x07, HEADER = 6 };
enum { VALID_DATE = 1, VALID_TIME = 2, FULLY_RESOLVED = 4, GNSS_FIX_OK = 1, INVALID_LLH = 1 };
#define HEADING_ACC_MOST_E5 18000000u /* 180 deg: not known */
#define DOP_NONE            9999u

static void put_u16(uint8_t *at, uint32_t x)
{
    at[0] = (uint8_t)x;
    at[1] = (uint8_t)(x >> 8);
}

static void put_u32(uint8_t *at, uint32_t x)
{
    put_u16(at, x);
    put_u16(at + 2, x >> 16);
}

static void put_i32(uint8_t *at, int32_t x)
{
    put_u32(at, (uint32_t)x);
}

static void put_time(uint8_t *p, const struct report *r)
{
    const struct calendar c = calendar_of(r->utc_ms);
    uint32_t week, tow_ms;
    report_gps_time(r, &week, &tow_ms);
    put_u32(p, tow_ms);
    put_u16(p + 4, (uint32_t)c.year);
    p[6] = (uint8_t)c.month;
    p[7] = (uint8_t)c.day;
    p[8] = (uint8_t)c.hour;
    p[9] = (uint8_t)c.minute;
    p[10] = (uint8_t)c.second;
    p[11] = VALID_DATE | VALID_TIME | FULLY_RESOLVED;
    put_u32(p + 12, r->t_acc_ns);
    put_i32(p + 16, (int32_t)c.ms * 1000000); /* nano: fraction of the second */
}

static void put_place(uint8_t *p, const struct report *r)
{
    put_i32(p + 24, r->lon_e7);
    put_i32(p + 28, r->lat_e7);
    put_i32(p + 32, r->h_mm);
    put_i32(p + 36, r->h_mm - r->geoid_mm);
    put_u32(p + 40, r->h_acc_mm);
    put_u32(p + 44, r->v_acc_mm);
}

/* Of the direction of motion: the cross component's standard deviation over the speed. */
static uint32_t heading_acc_e5(const struct report *r)
{
    const uint32_t speed = report_speed_mmps(r);
    const uint64_t e5 = speed ? (uint64_t)r->s_acc_mmps * 5729578 / speed : HEADING_ACC_MOST_E5;
    return e5 < HEADING_ACC_MOST_E5 ? (uint32_t)e5 : HEADING_ACC_MOST_E5;
}

static void put_velocity(uint8_t *p, const struct report *r)
{
    put_i32(p + 48, r->v_n_mmps[1]);
    put_i32(p + 52, r->v_n_mmps[0]);
    put_i32(p + 56, -r->v_n_mmps[2]); /* down */
    put_u32(p + 60, report_speed_mmps(r));
    put_u32(p + 64, report_course_e5(r));
    put_u32(p + 68, r->s_acc_mmps);
    put_u32(p + 72, heading_acc_e5(r));
}

void ubx_checksum(const uint8_t *bytes, size_t len, uint8_t ck[2])
{
    ck[0] = ck[1] = 0;
    for (size_t i = 0; i < len; i++) {
        ck[0] = (uint8_t)(ck[0] + bytes[i]);
        ck[1] = (uint8_t)(ck[1] + ck[0]);
    }
}

void ubx_write_pvt(const struct report *r, uint8_t out[UBX_PVT_LEN])
{
    static const uint8_t header[HEADER] = {SYNC_1, SYNC_2, CLASS_NAV, ID_PVT, UBX_PVT_PAYLOAD, 0};
    const bool fix = r->fix != REPORT_NO_FIX;
    uint8_t *p = out + HEADER;
    memset(out, 0, UBX_PVT_LEN);
    memcpy(out, header, sizeof header);
    put_time(p, r);
    p[20] = (uint8_t)r->fix;
    p[21] = fix ? GNSS_FIX_OK : 0;
    p[23] = (uint8_t)(fix ? r->sats : 0);
    put_place(p, r);
    put_velocity(p, r);
    put_u16(p + 76, fix ? report_pdop_e2(r) : DOP_NONE);
    p[78] = fix ? 0 : INVALID_LLH;
    ubx_checksum(out + 2, HEADER - 2 + UBX_PVT_PAYLOAD, out + HEADER + UBX_PVT_PAYLOAD);
}
