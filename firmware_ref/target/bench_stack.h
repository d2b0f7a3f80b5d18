/* bench_stack.h - paints the free stack, and tells how many bytes of it have been overwritten since. */
#ifndef BENCH_STACK_H
#define BENCH_STACK_H

#include <stdint.h>

void bench_stack_paint(void);
uint32_t bench_stack_used(void);

#endif
