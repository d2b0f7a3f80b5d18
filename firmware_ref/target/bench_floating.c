#include "bench_floating.h"

uint32_t floating_set_temperature(floating_state_t *state, const floating_calib_t *calib,
                                  int32_t temp_code)
{
    const BENCH_REAL x = (BENCH_REAL)(temp_code - calib->origin_code) * calib->x_per_code;
    uint32_t i;
    for (i = 0u; i < 12u; i++) {
        const BENCH_REAL *const c = calib->coefficient[i];
        BENCH_REAL p = c[FLOATING_ORDER];
        int k;
        for (k = FLOATING_ORDER - 1; k >= 0; k--) {
            p = c[k] + (x * p);
        }
        state->row[i / 4u][i % 4u] = p;
    }
    return 0u;
}

uint32_t floating_apply(const floating_state_t *state, const int32_t raw_code[3],
                        BENCH_REAL accel[3])
{
    const BENCH_REAL u[3] = {(BENCH_REAL)raw_code[0], (BENCH_REAL)raw_code[1],
                             (BENCH_REAL)raw_code[2]};
    uint32_t i;
    for (i = 0u; i < 3u; i++) {
        const BENCH_REAL *const row = state->row[i];
        accel[i] = (row[0] * u[0]) + (row[1] * u[1]) + (row[2] * u[2]) + row[3];
    }
    return 0u;
}
