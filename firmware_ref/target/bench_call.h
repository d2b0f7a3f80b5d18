/* bench_call.h - one call of a routine between the two markers that the counter looks for. */
#ifndef BENCH_CALL_H
#define BENCH_CALL_H

#include <stdint.h>

#include "bench_stack.h"
#include "bench_subject.h"

typedef uint32_t (*bench_set_t)(subject_state_t *state, const subject_calib_t *calib,
                                int32_t temp RATE_PARAMETER);
typedef uint32_t (*bench_apply_t)(const subject_state_t *state, const int32_t raw[3],
                                  FORCE_PARAMETER int32_t accel[3]);

/* Every routine is called from the same instructions, so that the overhead is the same. */
uint32_t bench_call_set(bench_set_t routine, subject_state_t *state, const subject_calib_t *calib,
                        int32_t temp RATE_PARAMETER);
uint32_t bench_call_apply(bench_apply_t routine, const subject_state_t *state,
                          const int32_t raw[3], FORCE_PARAMETER int32_t accel[3]);

/* Of bench_known.S. */
uint32_t bench_empty_set(subject_state_t *state, const subject_calib_t *calib,
                         int32_t temp RATE_PARAMETER);
uint32_t bench_empty_apply(const subject_state_t *state, const int32_t raw[3],
                           FORCE_PARAMETER int32_t accel[3]);
uint32_t bench_loop(subject_state_t *state, const subject_calib_t *calib,
                    int32_t rounds RATE_PARAMETER);
void bench_begin(void);
void bench_end(void);

#endif
