/* From reset to main: vectors, code read protection, memory. */

#include "lpc1768.h"
#include "port.h"

extern uint32_t stack_top[];
extern uint32_t stack_limit[];
extern uint32_t data_image[];
extern uint32_t data_start[];
extern uint32_t data_end[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];
extern uint32_t vector_checksum[];

typedef void (*handler_t)(void);

void reset_handler(void);
void nmi_handler(void);
void fault_handler(void);

/* Start anew: the host sees another epoch, which says more than a board that hangs. */
void nmi_handler(void) { port_reset(); }
void fault_handler(void) { port_reset(); }

/* The addresses of linker symbols are the values. */
#define WORD(symbol) ((handler_t)(uintptr_t)(symbol))

__attribute__((section(".vectors"), used)) static const handler_t vectors[16 + LPC_IRQS] = {
    [0] = WORD(stack_top),
    [1] = reset_handler,
    [2] = nmi_handler,
    [3] = fault_handler, /* hard */
    [4] = fault_handler, /* memory */
    [5] = fault_handler, /* bus */
    [6] = fault_handler, /* usage */
    [7] = WORD(vector_checksum),
    [11] = fault_handler,
    [12] = fault_handler,
    [14] = fault_handler,
    [15] = fault_handler,
    /* no other interrupt is ever enabled */
    [16 + TIMER2_IRQ] = timer2_handler,
    [16 + UART0_IRQ] = uart0_handler,
    [16 + UART2_IRQ] = uart2_handler,
};

/* Code read protection, off.  Other values can lock the chip for good. */
__attribute__((section(".crp"), used)) static const uint32_t code_read_protection = 0xFFFFFFFFu;

static const uint32_t paint = 0xC5C5C5C5u;

/* Nothing may be on the stack yet that the paint would cover. */
__attribute__((naked, noreturn)) void reset_handler(void) {
  __asm volatile(
      "ldr r0, =stack_limit\n"
      "ldr r1, =stack_top\n"
      "ldr r2, =0xC5C5C5C5\n"
      "1: cmp r0, r1\n"
      "bhs 2f\n"
      "str r2, [r0], #4\n"
      "b 1b\n"
      "2: b start\n");
}

__attribute__((used, noreturn)) static void start(void) {
  const uint32_t *from = data_image;
  for (uint32_t *to = data_start; to < data_end; to++) {
    *to = *from;
    from++;
  }
  for (uint32_t *to = bss_start; to < bss_end; to++) {
    *to = 0;
  }
  port_main();
}

uint32_t port_free_stack(void) {
  const uint32_t *at = stack_limit;
  while (at < stack_top && *at == paint) {
    at++;
  }
  return (uint32_t)((uintptr_t)at - (uintptr_t)stack_limit);
}

/* What a compiler may call on its own. */
void *memcpy(void *restrict to, const void *restrict from, size_t size);
void *memset(void *to, int value, size_t size);

void *memcpy(void *restrict to, const void *restrict from, size_t size) {
  uint8_t *out = to;
  const uint8_t *in = from;
  for (size_t i = 0; i < size; i++) {
    out[i] = in[i];
  }
  return to;
}

void *memset(void *to, int value, size_t size) {
  uint8_t *out = to;
  for (size_t i = 0; i < size; i++) {
    out[i] = (uint8_t)value;
  }
  return to;
}
