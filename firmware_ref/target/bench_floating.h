/*
 * bench_floating.h - what one would write without triaxcal, in double or float (BENCH_REAL).
 *
 * The same polynomials of the same order on the same normalised temperature. It neither clamps
 * nor flags: it does less than the generated routine.
 */
#ifndef BENCH_FLOATING_H
#define BENCH_FLOATING_H

#include <stdint.h>

#define FLOATING_ORDER BENCH_ORDER

typedef struct {
    int32_t origin_code;
    BENCH_REAL x_per_code;
    BENCH_REAL coefficient[12][FLOATING_ORDER + 1];
} floating_calib_t;

/* g per raw code for x, y, z, and g. */
typedef struct {
    BENCH_REAL row[3][4];
} floating_state_t;

extern const floating_calib_t FLOATING_CALIB;

uint32_t floating_set_temperature(floating_state_t *state, const floating_calib_t *calib,
                                  int32_t temp_code);
uint32_t floating_apply(const floating_state_t *state, const int32_t raw_code[3],
                        BENCH_REAL accel[3]);

#endif
