/* uart.h - text out of the board's first UART (CMSDK APB UART at 0x40004000). */
#ifndef UART_H
#define UART_H

#include <stdint.h>

void uart_start(void);
void uart_print(const char *text);
void uart_print_decimal(int32_t value);

#endif
