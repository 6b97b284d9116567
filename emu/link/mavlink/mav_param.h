/* Parameters of the MAVLink link: rows of a table, and their values as MAVLink and SDO carry them. Pure.
 *
 * A number of at most 24 bits travels as REAL32, which holds it exactly, so that clients of both ways to encode integers
 * (bytewise, cast) read it alike; 32-bit integers travel bytewise, as the capabilities of the link say. */
#ifndef PSABENCH_LINK_MAVLINK_MAV_PARAM_H
#define PSABENCH_LINK_MAVLINK_MAV_PARAM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { MAV_PARAM_NAME = 16 }; /* most characters of a name; without a NUL when it has as many */

enum mav_param_type { /* numbers of MAV_PARAM_TYPE */
                      MAV_PARAM_U32 = 5,
                      MAV_PARAM_I32 = 6,
                      MAV_PARAM_R32 = 9
};

/* How an object of the unit encodes its number. */
enum mav_param_code { MAV_CODE_UNSIGNED, MAV_CODE_SIGNED, MAV_CODE_REAL };

struct mav_param {
    char name[MAV_PARAM_NAME + 1];
    bool object; /* of the unit, by SDO; else a value of the link or the bench */
    bool writable;
    uint8_t sub;
    uint8_t bytes;  /* of the object: 1..4 */
    uint8_t code;   /* enum mav_param_code */
    uint16_t index; /* object, or which value of the owner */
    double low, high;
};

enum mav_param_type mav_param_type(const struct mav_param *p);

/* The four bytes of param_value, which MAVLink declares as a float. */
float mav_param_wire(const struct mav_param *p, double value);

/* Value of a PARAM_SET of a type. False: the type is not the parameter's, or the value is no number. A REAL32 is taken for an
 * integer parameter as well if it is a whole number. */
bool mav_param_value(const struct mav_param *p, uint8_t type, float wire, double *value);

/* Bytes of the object, little-endian in the low bytes of the result, and the number of such bytes. */
uint32_t mav_param_raw(const struct mav_param *p, double value);
double mav_param_number(const struct mav_param *p, uint32_t raw);

/* Position of a name (up to 16 characters, NUL where it is shorter); count: there is none. */
unsigned mav_param_find(const struct mav_param *rows, unsigned count, const char *name);

#endif
