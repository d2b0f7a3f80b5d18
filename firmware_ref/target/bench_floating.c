#include "bench_floating.h"

enum { OK = 0, TEMP_LOW = 1, TEMP_HIGH = 2, RAW_RANGE = 4 };

uint32_t floating_set_temperature(floating_state_t *state, const floating_calib_t *calib,
                                  int32_t temp_code)
{
    uint32_t status = OK;
    int32_t code = temp_code;
    BENCH_REAL x;
    uint32_t i;

    if (code < calib->temp_min_code) {
        code = calib->temp_min_code;
        status = TEMP_LOW;
    }
    if (code > calib->temp_max_code) {
        code = calib->temp_max_code;
        status = TEMP_HIGH;
    }
    x = (BENCH_REAL)(code - calib->origin_code) * calib->x_per_code;
    for (i = 0u; i < 12u; i++) {
        const BENCH_REAL *const c = calib->coefficient[i];
        BENCH_REAL p = c[FLOATING_ORDER];
        int k;
        for (k = FLOATING_ORDER - 1; k >= 0; k--) {
            p = c[k] + (x * p);
        }
        state->row[i / 4u][i % 4u] = p;
    }
    return status;
}

uint32_t floating_apply(const floating_state_t *state, const int32_t raw_code[3], int32_t accel[3])
{
    const BENCH_REAL half = (BENCH_REAL)0.5;
    uint32_t status = OK;
    BENCH_REAL u[3];
    uint32_t i;

    for (i = 0u; i < 3u; i++) {
        int32_t code = raw_code[i];
#if BENCH_CHECKED
        if ((code < BENCH_RAW_MIN) || (code > BENCH_RAW_MAX)) {
            code = (code < BENCH_RAW_MIN) ? BENCH_RAW_MIN : BENCH_RAW_MAX;
            status = RAW_RANGE;
        }
#endif
        u[i] = (BENCH_REAL)code;
    }
    for (i = 0u; i < 3u; i++) {
        const BENCH_REAL *const row = state->row[i];
        const BENCH_REAL a = (row[0] * u[0]) + (row[1] * u[1]) + (row[2] * u[2]) + row[3];
        accel[i] = (int32_t)((a < 0) ? (a - half) : (a + half));
    }
    return status;
}
