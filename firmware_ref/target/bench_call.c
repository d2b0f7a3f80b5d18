#include "bench_call.h"

#define PAINT 0xC3A5965Au

extern uint32_t target_bss_end;
extern uint32_t target_stack_top;

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

static uint32_t *stack_pointer(void)
{
    uint32_t *here;
#if defined(__riscv)
    __asm__ volatile("mv %0, sp" : "=r"(here));
#else
    __asm__ volatile("mov %0, sp" : "=r"(here));
#endif
    return here;
}

void bench_stack_paint(void)
{
    volatile uint32_t *const top = stack_pointer();
    volatile uint32_t *word;
    for (word = &target_bss_end; word < top; word++) {
        *word = PAINT;
    }
}

uint32_t bench_stack_used(void)
{
    volatile uint32_t *word = &target_bss_end;
    while (word < &target_stack_top && *word == PAINT) {
        word++;
    }
    return 4u * (uint32_t)(&target_stack_top - word);
}
