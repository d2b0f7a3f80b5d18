/* riscv_start.S - from reset to main in machine mode; memory is RAM that the loader has filled. */
    .section .vectors, "ax"
    .global target_reset
target_reset:
    .option push
    .option norelax
    la gp, __global_pointer$
    .option pop
    la sp, target_stack_top
    la t0, target_trap
    .word 0x30529073 /* csrw mtvec, t0: without asking the assembler for Zicsr */
    la t0, target_bss_start
    la t1, target_bss_end
1:  bgeu t0, t1, 2f
    sw zero, 0(t0)
    addi t0, t0, 4
    j 1b
2:  call main
    j target_exit
    .align 2
target_trap:
    la a0, 3f
    call target_print
    li a0, 1
    j target_exit
3:  .asciz "fault\n"
