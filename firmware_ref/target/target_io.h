/* target_io.h - what the test programs need of the world: text, and an end. */
#ifndef TARGET_IO_H
#define TARGET_IO_H

#include <stdint.h>

void target_print(const char *text);
void target_print_decimal(uint32_t value);
void target_print_hex(uint32_t value);

/* Ends the emulation; 0 is success. */
#if defined(__GNUC__)
__attribute__((noreturn))
#endif
void target_exit(int code);

#endif
