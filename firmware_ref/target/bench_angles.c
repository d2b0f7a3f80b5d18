/*
 * bench_angles.c - calls triax_angles, or the same in double, with the inputs of angles_case.h;
 * count_plugin.c counts each call. Printed: the sections with their number of calls, in order, and
 * bytes of stack.
 */
#include "angles_case.h"
#include "bench_angles.h"
#include "bench_stack.h"
#include "target_io.h"

typedef uint32_t (*angles_t)(const int32_t accel[3], subject_angle_t angle[2]);
typedef void (*rounds_t)(uint32_t first, uint32_t second, uint32_t rounds);

/* Of bench_known.S. */
uint32_t bench_empty_apply(const int32_t accel[3], subject_angle_t angle[2]);
void bench_empty_set(uint32_t first, uint32_t second, uint32_t rounds);
void bench_loop(uint32_t first, uint32_t second, uint32_t rounds);
void bench_begin(void);
void bench_end(void);

static subject_angle_t angle[2];
static const uint32_t LOOP_ROUNDS[] = {1, 10, 100, 1000};

#if defined(__GNUC__)
__attribute__((noinline))
#endif
static uint32_t call(angles_t routine, const int32_t accel[3])
{
    uint32_t status;
    bench_begin();
    status = routine(accel, angle);
    bench_end();
    return status;
}

#if defined(__GNUC__)
__attribute__((noinline))
#endif
static void call_rounds(rounds_t routine, uint32_t rounds)
{
    bench_begin();
    routine(0u, 0u, rounds);
    bench_end();
}

static void print_line(const char *name, uint32_t value)
{
    target_print(name);
    target_print(" ");
    target_print_decimal(value);
    target_print("\n");
}

int main(void)
{
    uint32_t empty;
    uint32_t i;
    call_rounds(bench_empty_set, 0u);
    print_line("empty_set", 1u);
    (void)call(bench_empty_apply, CASE_ACCEL[0]);
    print_line("empty_apply", 1u);
    for (i = 0u; i < 4u; i++) {
        call_rounds(bench_loop, LOOP_ROUNDS[i]);
    }
    print_line("loop", 4u);
    for (i = 0u; i < CASE_ACCEL_COUNT; i++) {
        (void)call(subject_angles, CASE_ACCEL[i]);
    }
    print_line("angles", CASE_ACCEL_COUNT);
    bench_stack_paint();
    (void)call(bench_empty_apply, CASE_ACCEL[0]);
    empty = bench_stack_used();
    bench_stack_paint();
    for (i = 0u; i < CASE_ACCEL_COUNT; i++) {
        (void)call(subject_angles, CASE_ACCEL[i]);
    }
    print_line("stack_angles", bench_stack_used() - empty);
    return 0;
}
