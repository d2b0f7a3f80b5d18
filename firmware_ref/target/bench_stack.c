#include "bench_stack.h"

#define PAINT 0xC3A5965Au

extern uint32_t target_bss_end;
extern uint32_t target_stack_top;

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
