#include "bench_call.h"

uint32_t bench_call_set(bench_set_t routine, subject_state_t *state, const subject_calib_t *calib,
                        int32_t temp RATE_PARAMETER)
{
    uint32_t status;
    bench_begin();
    status = routine(state, calib, temp RATE_ARGUMENT(rate));
    bench_end();
    return status;
}

uint32_t bench_call_apply(bench_apply_t routine, const subject_state_t *state,
                          const int32_t raw[3], FORCE_PARAMETER int32_t accel[3])
{
    uint32_t status;
    bench_begin();
    status = routine(state, raw, FORCE_ARGUMENT(force) accel);
    bench_end();
    return status;
}
