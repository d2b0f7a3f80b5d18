#include "uart.h"

typedef struct {
    volatile uint32_t data;
    volatile uint32_t state;
    volatile uint32_t control;
    volatile uint32_t interrupt;
    volatile uint32_t divider;
} cmsdk_uart_t;

#define UART0 ((cmsdk_uart_t *)0x40004000u)
#define STATE_TX_FULL 1u
#define CONTROL_TX_ENABLE 1u
#define DIVIDER 217u /* 25 MHz to 115200 baud */

void uart_start(void)
{
    UART0->divider = DIVIDER;
    UART0->control = CONTROL_TX_ENABLE;
}

void uart_print(const char *text)
{
    const char *next;
    for (next = text; *next != '\0'; next++) {
        while ((UART0->state & STATE_TX_FULL) != 0u) {
        }
        UART0->data = (uint32_t)*next;
    }
}

void uart_print_decimal(int32_t value)
{
    char text[12];
    int at = 11;
    /* The magnitude as unsigned: INT32_MIN has no positive counterpart. */
    uint32_t rest = (value < 0) ? (0u - (uint32_t)value) : (uint32_t)value;
    text[at] = '\0';
    do {
        at--;
        text[at] = (char)('0' + (int)(rest % 10u));
        rest /= 10u;
    } while (rest != 0u);
    if (value < 0) {
        at--;
        text[at] = '-';
    }
    uart_print(&text[at]);
}
