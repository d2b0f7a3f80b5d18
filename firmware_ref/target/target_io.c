#include "target_io.h"

#if defined(TARGET_HOSTED)
#include <stdio.h>
#include <stdlib.h>

void target_print(const char *text)
{
    (void)fputs(text, stdout);
}

void target_exit(int code)
{
    exit(code);
}

#elif defined(__AVR__)
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

/* simavr prints what the serial port sends, and ends when the core sleeps without interrupts. */
static void send(char c)
{
    while ((UCSR0A & (1u << UDRE0)) == 0u) {
    }
    UCSR0A = (uint8_t)(1u << TXC0); /* cleared by writing 1 */
    UDR0 = (uint8_t)c;
}

void target_print(const char *text)
{
    const char *c;
    UCSR0B = (uint8_t)(1u << TXEN0);
    for (c = text; *c != '\0'; c++) {
        send(*c);
    }
}

void target_exit(int code)
{
    (void)code; /* simavr has no use for it: the lines that were printed are what counts */
    while ((UCSR0A & (1u << TXC0)) == 0u) {
    }
    cli();
    for (;;) {
        sleep_mode();
    }
}

/* In place of the library's: the start-up code calls it with the result of main. */
void exit(int code);

void exit(int code)
{
    target_exit(code);
}

#else
#include <stddef.h>

/* Arm's semihosting calls, which QEMU answers on Arm and on RISC-V. */
#define SYS_WRITE0 0x04u
#define SYS_EXIT 0x18u
#define STOPPED_APPLICATION_EXIT 0x20026u
#define STOPPED_RUN_TIME_ERROR 0x20023u

static void semihosting(uintptr_t operation, uintptr_t argument)
{
#if defined(__riscv)
    register uintptr_t a0 __asm__("a0") = operation;
    register uintptr_t a1 __asm__("a1") = argument;
    /* The three instructions must be uncompressed and on one page. */
    __asm__ volatile(".balign 16\n\t"
                     ".option push\n\t.option norvc\n\t"
                     "slli x0, x0, 0x1f\n\tebreak\n\tsrai x0, x0, 7\n\t"
                     ".option pop"
                     : "+r"(a0)
                     : "r"(a1)
                     : "memory");
#else
    register uintptr_t r0 __asm__("r0") = operation;
    register uintptr_t r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
#endif
}

void target_print(const char *text)
{
    semihosting(SYS_WRITE0, (uintptr_t)text);
}

void target_exit(int code)
{
    for (;;) {
        semihosting(SYS_EXIT, (code == 0) ? STOPPED_APPLICATION_EXIT : STOPPED_RUN_TIME_ERROR);
    }
}

/* Compilers call these for copies and zeroing of their own; there is no libc here. */
void *memcpy(void *to, const void *from, size_t size);
void *memset(void *to, int value, size_t size);

void *memcpy(void *to, const void *from, size_t size)
{
    volatile uint8_t *t = to; /* volatile: or the loop becomes a call of itself */
    const uint8_t *f = from;
    size_t i;
    for (i = 0; i < size; i++) {
        t[i] = f[i];
    }
    return to;
}

void *memset(void *to, int value, size_t size)
{
    volatile uint8_t *t = to;
    size_t i;
    for (i = 0; i < size; i++) {
        t[i] = (uint8_t)value;
    }
    return to;
}

#if defined(__arm__)
/* The names of Arm's run-time ABI, which clang calls; memset has its arguments the other way. */
void __aeabi_memcpy(void *to, const void *from, size_t size);
void __aeabi_memcpy4(void *to, const void *from, size_t size);
void __aeabi_memcpy8(void *to, const void *from, size_t size);
void __aeabi_memset(void *to, size_t size, int value);
void __aeabi_memclr(void *to, size_t size);
void __aeabi_memclr4(void *to, size_t size);
void __aeabi_memclr8(void *to, size_t size);

void __aeabi_memcpy(void *to, const void *from, size_t size)
{
    (void)memcpy(to, from, size);
}

void __aeabi_memcpy4(void *to, const void *from, size_t size)
{
    (void)memcpy(to, from, size);
}

void __aeabi_memcpy8(void *to, const void *from, size_t size)
{
    (void)memcpy(to, from, size);
}

void __aeabi_memset(void *to, size_t size, int value)
{
    (void)memset(to, value, size);
}

void __aeabi_memclr(void *to, size_t size)
{
    (void)memset(to, 0, size);
}

void __aeabi_memclr4(void *to, size_t size)
{
    (void)memset(to, 0, size);
}

void __aeabi_memclr8(void *to, size_t size)
{
    (void)memset(to, 0, size);
}
#endif
#endif

void target_print_decimal(uint32_t value)
{
    char text[11];
    uint32_t rest = value;
    int at = 10;
    text[at] = '\0';
    do {
        at--;
        text[at] = (char)('0' + (int)(rest % 10u));
        rest /= 10u;
    } while (rest != 0u);
    target_print(&text[at]);
}

void target_print_hex(uint32_t value)
{
    static const char DIGITS[] = "0123456789abcdef";
    char text[9];
    int i;
    for (i = 0; i < 8; i++) {
        text[i] = DIGITS[(value >> (28 - (4 * i))) & 15u];
    }
    text[8] = '\0';
    target_print(text);
}
