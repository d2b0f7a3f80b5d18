/*
 * bench_known.S - routines whose instructions can be counted by eye: 1, and 2 n + 1 for the loop.
 * They check the counter and give the overhead of a measured call.
 */
#if defined(__riscv)
    .text
    .global bench_empty_set, bench_empty_apply, bench_loop, bench_begin, bench_end
bench_empty_set:
    ret
bench_empty_apply:
    ret
bench_loop:
1:  addi a2, a2, -1
    bnez a2, 1b
    ret
bench_begin:
    ret
bench_end:
    ret
#else
    .syntax unified
    .thumb
    .text
    .macro routine name
    .global \name
    .thumb_func
    .type \name, %function
\name:
    .endm
    routine bench_empty_set
    bx lr
    routine bench_empty_apply
    bx lr
    routine bench_loop
1:  subs r2, r2, #1
    bne 1b
    bx lr
    routine bench_begin
    bx lr
    routine bench_end
    bx lr
#endif
