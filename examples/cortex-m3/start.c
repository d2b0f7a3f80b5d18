/* start.c - vector table, and from reset to main. */
#include <stdint.h>

extern uint32_t stack_top, data_start, data_end, bss_start, bss_end;
extern const uint32_t data_image;

int main(void);
void reset(void);
void stop(void);

void stop(void)
{
    for (;;) {
    }
}

void reset(void)
{
    const uint32_t *from = &data_image;
    uint32_t *to;
    for (to = &data_start; to < &data_end; to++) {
        *to = *from++;
    }
    for (to = &bss_start; to < &bss_end; to++) {
        *to = 0u;
    }
    (void)main();
    stop();
}

__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*vector[15])(void);
} VECTORS = {
    &stack_top,
    {reset, stop, stop, stop, stop, stop, stop, stop, stop, stop, stop, stop, stop, stop, stop},
};
