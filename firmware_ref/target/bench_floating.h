/*
 * bench_floating.h - what one would write without triaxcal, in double or float (BENCH_REAL).
 *
 * The same job: the same polynomials on the same normalised temperature, the same clamping and
 * flags, the same integers out, rounded to nearest. It may differ in the last places.
 */
#ifndef BENCH_FLOATING_H
#define BENCH_FLOATING_H

#include <stdint.h>

#define FLOATING_ORDER BENCH_ORDER

typedef struct {
    int32_t temp_min_code;
    int32_t temp_max_code;
    int32_t origin_code;
    BENCH_REAL x_per_code;
    BENCH_REAL coefficient[12][FLOATING_ORDER + 1];
} floating_calib_t;

/* Output LSB per raw code for x, y, z, and output LSB. */
typedef struct {
    BENCH_REAL row[3][4];
} floating_state_t;

extern const floating_calib_t FLOATING_CALIB;

uint32_t floating_set_temperature(floating_state_t *state, const floating_calib_t *calib,
                                  int32_t temp_code);
uint32_t floating_apply(const floating_state_t *state, const int32_t raw_code[3], int32_t accel[3]);

#endif
