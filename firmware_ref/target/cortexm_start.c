/* cortexm_start.c - from reset to main on any Cortex-M: stack, FPU, .data, .bss. */
#include <stdint.h>

#include "target_io.h"

extern uint32_t target_stack_top;
extern uint32_t target_data_start;
extern uint32_t target_data_end;
extern const uint32_t target_data_image;
extern uint32_t target_bss_start;
extern uint32_t target_bss_end;

int main(void);
void target_reset(void);
void target_fault(void);

void target_fault(void)
{
    target_print("fault\n");
    target_exit(1);
}

void target_reset(void)
{
    const uint32_t *from = &target_data_image;
    uint32_t *to;
#if defined(__ARM_FP)
    /* CPACR: full access to CP10 and CP11, before the first instruction of the FPU. */
    *(volatile uint32_t *)0xE000ED88u |= 0x00F00000u;
    __asm__ volatile("dsb\n\tisb");
#endif
    for (to = &target_data_start; to < &target_data_end; to++) {
        *to = *from++;
    }
    for (to = &target_bss_start; to < &target_bss_end; to++) {
        *to = 0u;
    }
    target_exit(main());
}

typedef void (*vector_t)(void);

/* The first word is the stack's top, the others are reset, NMI and the faults. */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    vector_t vector[15];
} VECTORS = {
    &target_stack_top,
    {target_reset, target_fault, target_fault, target_fault, target_fault, target_fault,
     target_fault, target_fault, target_fault, target_fault, target_fault, target_fault,
     target_fault, target_fault, target_fault},
};
