/*
 * bench_main.c - calls the routine under test with the inputs of bench_case.h, one section after
 * another; count_plugin.c counts each call. Printed: the sections with their number of calls, in
 * order, and bytes of stack.
 */
#include "bench_call.h"
#include "bench_case.h"
#include "target_io.h"

#if defined(TRIAX_RATE_Q)
#define RATES_PARAMETER , const int32_t *rate
#else
#define RATES_PARAMETER
#endif

static subject_state_t state;
static int32_t accel[3];
static const int32_t LOOP_ROUNDS[] = {1, 10, 100, 1000};

static void print_line(const char *name, uint32_t value)
{
    target_print(name);
    target_print(" ");
    target_print_decimal(value);
    target_print("\n");
}

/* A temperature out of range comes with a rate out of range. */
static void count_set(const char *name, const int32_t *temp, uint32_t count RATES_PARAMETER)
{
    uint32_t i;
    for (i = 0u; i < count; i++) {
        (void)bench_call_set(subject_set_temperature, &state, SUBJECT_CALIB,
                             temp[i] RATE_ARGUMENT(rate[i % CASE_RATE_COUNT]));
    }
    print_line(name, count);
}

/* The state is that of the temperature at the same place of the other table. */
static void count_apply(const char *name, const int32_t (*raw)[3], uint32_t count)
{
    uint32_t i;
    for (i = 0u; i < count; i++) {
        (void)subject_set_temperature(&state, SUBJECT_CALIB,
                                      CASE_TEMP[i % CASE_TEMP_COUNT] RATE_ARGUMENT(CASE_RATE[0]));
        (void)bench_call_apply(subject_apply, &state, raw[i],
                               FORCE_ARGUMENT(CASE_FORCE[i % CASE_FORCE_COUNT]) accel);
    }
    print_line(name, count);
}

static void count_known(void)
{
    uint32_t i;
    (void)bench_call_set(bench_empty_set, &state, SUBJECT_CALIB, 0 RATE_ARGUMENT(0));
    print_line("empty_set", 1u);
    (void)bench_call_apply(bench_empty_apply, &state, CASE_RAW[0], FORCE_ARGUMENT(CASE_FORCE[0]) accel);
    print_line("empty_apply", 1u);
    for (i = 0u; i < 4u; i++) {
        (void)bench_call_set(bench_loop, &state, SUBJECT_CALIB, LOOP_ROUNDS[i] RATE_ARGUMENT(0));
    }
    print_line("loop", 4u);
}

/* Stack of each routine: the deepest of a few calls less that of an empty routine. Not counted. */
static void measure_stack(void)
{
    uint32_t empty;
    bench_stack_paint();
    (void)bench_call_set(bench_empty_set, &state, SUBJECT_CALIB, 0 RATE_ARGUMENT(0));
    empty = bench_stack_used();
    bench_stack_paint();
    (void)bench_call_set(subject_set_temperature, &state, SUBJECT_CALIB,
                         CASE_TEMP[0] RATE_ARGUMENT(CASE_RATE[0]));
    (void)bench_call_set(subject_set_temperature, &state, SUBJECT_CALIB,
                         CASE_TEMP_OUT[0] RATE_ARGUMENT(CASE_RATE_OUT[0]));
    print_line("stack_set", bench_stack_used() - empty);
    bench_stack_paint();
    (void)bench_call_apply(bench_empty_apply, &state, CASE_RAW[0], FORCE_ARGUMENT(CASE_FORCE[0]) accel);
    empty = bench_stack_used();
    bench_stack_paint();
    (void)bench_call_apply(subject_apply, &state, CASE_RAW[0], FORCE_ARGUMENT(CASE_FORCE[0]) accel);
    (void)bench_call_apply(subject_apply, &state, CASE_RAW_OUT[0], FORCE_ARGUMENT(CASE_FORCE[0]) accel);
    print_line("stack_apply", bench_stack_used() - empty);
}

int main(void)
{
    count_known();
    count_set("set", CASE_TEMP, CASE_TEMP_COUNT RATE_ARGUMENT(CASE_RATE));
    count_set("set_out", CASE_TEMP_OUT, CASE_TEMP_OUT_COUNT RATE_ARGUMENT(CASE_RATE_OUT));
    count_apply("apply", CASE_RAW, CASE_RAW_COUNT);
    count_apply("apply_out", CASE_RAW_OUT, CASE_RAW_OUT_COUNT);
    print_line("state_bytes", (uint32_t)sizeof state);
    print_line("calib_bytes", (uint32_t)sizeof(subject_calib_t));
    measure_stack();
    return 0;
}
