/* bench_subject.h - what bench_main.c measures: the generated routine, or a floating baseline. */
#ifndef BENCH_SUBJECT_H
#define BENCH_SUBJECT_H

#if defined(BENCH_REAL)
#include "bench_floating.h"
typedef floating_state_t subject_state_t;
typedef floating_calib_t subject_calib_t;
#define subject_set_temperature floating_set_temperature
#define subject_apply floating_apply
#define SUBJECT_CALIB (&FLOATING_CALIB)
#else
#include "triax_comp.h"
typedef triax_state_t subject_state_t;
typedef triax_calib_t subject_calib_t;
#define subject_set_temperature triax_set_temperature
#define subject_apply triax_apply
extern const triax_calib_t TRIAX_CALIB;
#define SUBJECT_CALIB (&TRIAX_CALIB)
#endif

#endif
