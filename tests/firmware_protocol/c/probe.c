/* A program for the processor models: timer interrupts with a UART interrupt above them, both checked for what an
 * exception must leave alone, and sensor 0 read by SPI.  It reports through UART0, one letter and a number a line. */
#include <stdint.h>

#define R(address) (*(volatile uint32_t *)(address))
#define UART(offset) R(0x4000C000u + (offset))
#define TIMER(offset) R(0x40090000u + (offset))
#define SSP(offset) R(0x40088000u + (offset))
#define PORT0(offset) R(0x2009C000u + (offset))

extern uint32_t stack_top;
void start(void);
void on_timer(void);
void on_uart(void);

static volatile uint32_t ticks, nested, in_timer, sent, wrong;
static const char *volatile text;
static char line[16];

static void fault(void) { for (;;) { } }

__attribute__((section(".vectors"), used)) void (*const vectors[16 + 35])(void) = {
    [0] = (void (*)(void))&stack_top, [1] = start, [3] = fault, [16 + 3] = on_timer, [16 + 5] = on_uart,
};

void on_timer(void)
{
    TIMER(0x00) = 1;
    TIMER(0x18) += 96000u;
    in_timer = 1;
    ticks++;
    uint32_t here;
    __asm volatile("mov %0, sp" : "=r"(here));
    wrong += (here & 7u) != 0;
    for (volatile int i = 0; i < 500; i++) { }
    in_timer = 0;
}

void on_uart(void)
{
    uint32_t const cause = UART(0x08) & 15u;
    if (cause == 4u || cause == 12u) {
        uint32_t const got = UART(0x00);
        UART(0x00) = got + 1u;
    } else if (cause == 2u) {
        nested += in_timer;
        for (int i = 0; i < 16 && *text != 0; i++) { UART(0x00) = (uint32_t)*text++; }
        sent++;
    }
}

static void say(char what, uint32_t value)
{
    char *p = line;
    *p++ = what;
    for (int shift = 28; shift >= 0; shift -= 4) { *p++ = "0123456789abcdef"[value >> shift & 15u]; }
    *p++ = '\n';
    *p = 0;
    uint32_t const before = sent;
    text = line + 1;
    UART(0x00) = (uint32_t)line[0];
    while (sent - before < 2u) { __asm volatile("wfi"); } /* the line written, the line gone */
}

static uint32_t spi(uint32_t word)
{
    SSP(0x08) = word;
    while (SSP(0x0C) & 16u) { }
    return SSP(0x08);
}

static uint32_t device(void)
{
    PORT0(0x1C) = 1u << 16;
    uint32_t const id = spi(0x8000u) & 0xFFu;
    PORT0(0x18) = 1u << 16;
    return id;
}

static uint32_t churn(uint32_t seed)
{
    for (int i = 0; i < 20000; i++) { seed = seed * 1664525u + 1013904223u + (seed > 0x80000000u ? (uint32_t)i : 0u); }
    return seed;
}

void start(void)
{
    ticks = nested = in_timer = sent = wrong = 0;
    text = "";
    R(0x400FC1A8) = 1u << 6;  /* PCLKSEL0: UART0 = CCLK */
    R(0x400FC1AC) = 1u << 10 | 1u << 12; /* PCLKSEL1: SSP0 and TIMER2 = CCLK */
    UART(0x0C) = 0x83; UART(0x00) = 2; UART(0x04) = 0; UART(0x28) = 0x10; UART(0x0C) = 3; UART(0x08) = 0x81;
    UART(0x04) = 3;
    SSP(0x00) = 0x9CF; SSP(0x10) = 2; SSP(0x04) = 2;
    PORT0(0x18) = 1u << 16; PORT0(0x00) = 1u << 16;
    TIMER(0x14) = 1; TIMER(0x18) = 96000; TIMER(0x04) = 1;
    R(0xE000E400) = 2u << 27; /* IRQ 3 below IRQ 5 */
    R(0xE000E100) = 1u << 3 | 1u << 5;
    for (uint32_t round = 0;; round++) {
        say('c', churn(round));
        say('d', device());
        say('t', ticks);
        say('n', nested);
        say('w', wrong);
    }
}
