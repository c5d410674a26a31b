/*
 * The board on ARM's MPS2 (AN385) as QEMU has it: the same core, drivers and board on another Cortex-M3, with interrupts that
 * QEMU takes, its PL022 and its free-running counter.  A second opinion on the emulated LPC1768, not a product.
 *
 * The PL022 works in loopback: what a sensor's model answers is sent and received again, through the same FIFOs that the LPC1768's SSP has.
 */

#include "gf_board.h"
#include "gf_ring.h"
#include "sensor.h"

typedef volatile uint32_t reg_t;

typedef struct {
  reg_t CTRL;
  reg_t VALUE;
  reg_t RELOAD;
  reg_t INTCLEAR;
} timer_t;

typedef struct {
  reg_t DATA;
  reg_t STATE;
  reg_t CTRL;
  reg_t INTCLEAR;
  reg_t BAUDDIV;
} uart_t;

typedef struct {
  reg_t CR0;
  reg_t CR1;
  reg_t DR;
  reg_t SR;
  reg_t CPSR;
} pl022_t;

#define TIMER0 ((timer_t *)0x40000000u)
#define TIMER1 ((timer_t *)0x40001000u)
#define UART0 ((uart_t *)0x40004000u)
#define SPI0 ((pl022_t *)0x40020000u)
#define COUNTER (*(reg_t *)0x40028018u) /* 25 MHz, never stops */
#define NVIC_ISER0 (*(reg_t *)0xE000E100u)
#define NVIC_PRIORITY ((volatile uint8_t *)0xE000E400u)
#define SCB_AIRCR (*(reg_t *)0xE000ED0Cu)

enum {
  HZ = 25000000,
  TIMER_ON = 1 | 8, /* with its interrupt */
  UART_TX_FULL = 1,
  UART_RX_FULL = 2,
  UART_ALL_ON = 15, /* both ways, with interrupts */
  UART_TX_INTERRUPT = 1,
  UART_RX_INTERRUPT = 2,
  UART_RX_IRQ = 0,
  UART_TX_IRQ = 1,
  TIMER0_IRQ = 8,
  TIMER1_IRQ = 9,
  SSP_LOOPBACK_ON = 3,
  SSP_SIXTEEN_BITS_MODE_3 = 15 | (3 << 6),
  SSP_BUSY = 16,
  SSP_NOT_EMPTY = 4
};

extern uint32_t stack_top[];
extern uint32_t data_image[];
extern uint32_t data_start[];
extern uint32_t data_end[];
extern uint32_t bss_start[];
extern uint32_t bss_end[];

static gf_board_t board;
static sensor_t sensors[GF_SPI_DEVICES];
static volatile uint8_t in_bytes[256];
static volatile uint8_t out_bytes[8192];
static gf_ring_t in_ring;
static gf_ring_t out_ring;
static gf_pulses_t no_pulses;
static volatile uint32_t rounds;
static volatile uint32_t sending;
static uint64_t asleep;
static uint32_t reboot_wanted;

static void irq_off(void) { __asm volatile("cpsid i" ::: "memory"); }
static void irq_on(void) { __asm volatile("cpsie i\n isb" ::: "memory"); }

static uint32_t irq_save(void) {
  uint32_t primask;
  __asm volatile("mrs %0, primask\n cpsid i" : "=r"(primask)::"memory");
  return primask;
}

static void irq_restore(uint32_t primask) { __asm volatile("msr primask, %0" ::"r"(primask) : "memory"); }

static uint64_t now(void *context) {
  static uint32_t last;
  static uint32_t wraps;
  const uint32_t primask = irq_save();
  const uint32_t count = COUNTER;
  uint64_t ticks;
  (void)context;
  wraps += count < last ? 1u : 0u;
  last = count;
  ticks = ((uint64_t)wraps << 32) | count;
  irq_restore(primask);
  return ticks;
}

static uint8_t exchange(void *context, uint8_t mask, const uint16_t *out, uint16_t in[][GF_SPI_WORDS], uint8_t n) {
  (void)context;
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    uint16_t answer[GF_SPI_WORDS];
    if ((((uint32_t)mask >> i) & 1u) == 0u) {
      continue;
    }
    sensor_answer(&sensors[i], out, answer, n);
    for (uint32_t word = 0; word < n; word++) {
      SPI0->DR = answer[word];
    }
    while ((SPI0->SR & SSP_BUSY) != 0u) {
    }
    for (uint32_t word = 0; word < n; word++) {
      in[i][word] = (SPI0->SR & SSP_NOT_EMPTY) != 0u ? (uint16_t)SPI0->DR : 0u;
    }
  }
  return mask;
}

static void no_pause(void *context) { (void)context; }

static uint8_t no_adc(void *context, uint8_t mask, uint16_t *values) {
  (void)context;
  (void)mask;
  (void)values;
  return 0;
}

static void set_period(void *context, uint32_t ticks) {
  (void)context;
  TIMER0->CTRL = 0;
  TIMER0->INTCLEAR = 1;
  if (ticks != 0u) {
    TIMER0->RELOAD = ticks - 1u;
    TIMER0->VALUE = ticks - 1u;
    TIMER0->CTRL = TIMER_ON;
  }
}

static uint64_t idle(void *context) {
  (void)context;
  return asleep;
}

static uint32_t none(void *context) {
  (void)context;
  return 0;
}

static void reboot(void *context) {
  (void)context;
  reboot_wanted = 1;
}

/* The transmitter holds one byte; its interrupt comes when that has left. */
static void feed(void) {
  uint8_t byte;
  sending = 0;
  while ((UART0->STATE & UART_TX_FULL) == 0u && gf_ring_take(&out_ring, &byte, 1) != 0u) {
    UART0->DATA = byte;
    sending = 1;
  }
  sending = gf_ring_used(&out_ring) != 0u ? 1u : sending;
}

static int host_write(void *context, const uint8_t *bytes, size_t size) {
  const int taken = gf_ring_put_all(&out_ring, bytes, size);
  const uint32_t primask = irq_save();
  (void)context;
  if (sending == 0u) {
    feed();
  }
  irq_restore(primask);
  return taken;
}

static size_t host_read(void *context, uint8_t *bytes, size_t size) { return gf_ring_take(context, bytes, size); }

static size_t no_read(void *context, uint8_t *bytes, size_t size) {
  (void)context;
  (void)bytes;
  (void)size;
  return 0;
}

static int any_baud(void *context, uint32_t baud) {
  (void)context;
  (void)baud;
  return 1;
}

static void set_baud(void *context, uint32_t baud) {
  (void)context;
  (void)baud;
}

static void uart_rx_handler(void) {
  UART0->INTCLEAR = UART_RX_INTERRUPT;
  while ((UART0->STATE & UART_RX_FULL) != 0u) {
    (void)gf_ring_put(&in_ring, (uint8_t)(UART0->DATA & 0xFFu));
  }
}

static void uart_tx_handler(void) {
  UART0->INTCLEAR = UART_TX_INTERRUPT;
  feed();
}

static void timer0_handler(void) {
  TIMER0->INTCLEAR = 1;
  gf_board_tick(&board, now(NULL), 0);
}

static void timer1_handler(void) {
  TIMER1->INTCLEAR = 1;
  rounds++;
}

static void start_port(void) {
  gf_port_t *port = &board.port;
  const gf_line_t host = {&in_ring, host_write, host_read, any_baud, set_baud, none};
  const gf_line_t gnss = {NULL, host_write, no_read, any_baud, set_baud, none};
  const gf_capture_t capture = {&no_pulses, gf_pulses_next, gf_pulses_overflows};
  gf_ring_start(&in_ring, in_bytes, sizeof in_bytes);
  gf_ring_start(&out_ring, out_bytes, sizeof out_bytes);
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    sensor_power_on(&sensors[i], i);
  }
  port->spi.exchange = exchange;
  port->spi.pause = no_pause;
  port->adc.read = no_adc;
  port->host = host;
  port->gnss = gnss;
  port->tacho = capture;
  port->pps = capture;
  port->tick_hz = HZ;
  port->now = now;
  port->set_period = set_period;
  port->idle_ticks = idle;
  port->free_stack = none;
  port->reboot = reboot;
  port->simulated = 1;
}

static void start_devices(void) {
  SPI0->CR0 = SSP_SIXTEEN_BITS_MODE_3;
  SPI0->CPSR = 2;
  SPI0->CR1 = SSP_LOOPBACK_ON;
  UART0->BAUDDIV = 16; /* the fastest; QEMU does not wait for bits */
  UART0->CTRL = UART_ALL_ON;
  TIMER1->RELOAD = HZ / 100 - 1;
  TIMER1->VALUE = HZ / 100 - 1;
  TIMER1->CTRL = TIMER_ON;
  NVIC_PRIORITY[TIMER0_IRQ] = 2u << 5; /* the sample yields to the line */
  NVIC_PRIORITY[TIMER1_IRQ] = 3u << 5;
  NVIC_ISER0 = (1u << UART_RX_IRQ) | (1u << UART_TX_IRQ) | (1u << TIMER0_IRQ) | (1u << TIMER1_IRQ);
}

static void sleep_until_something(void) {
  static uint32_t seen;
  irq_off();
  while (board.put == board.taken && gf_ring_used(&in_ring) == 0u && rounds == seen) {
    const uint32_t from = COUNTER;
    __asm volatile("dsb\n wfi" ::: "memory");
    asleep += (uint32_t)(COUNTER - from);
    irq_on();
    irq_off();
  }
  seen = rounds;
  irq_on();
}

void reset_handler(void);
__attribute__((noreturn)) void reset_handler(void) {
  const uint32_t *from = data_image;
  for (uint32_t *to = data_start; to < data_end; to++) {
    *to = *from;
    from++;
  }
  for (uint32_t *to = bss_start; to < bss_end; to++) {
    *to = 0;
  }
  start_port();
  start_devices();
  gf_board_start(&board);
  for (;;) {
    gf_board_step(&board);
    if (reboot_wanted != 0u && sending == 0u && (UART0->STATE & UART_TX_FULL) == 0u) {
      SCB_AIRCR = 0x05FA0004u; /* what was written has left */
    }
    sleep_until_something();
  }
}

static void fault_handler(void) { SCB_AIRCR = 0x05FA0004u; }

typedef void (*handler_t)(void);

__attribute__((section(".vectors"), used)) static const handler_t vectors[16 + 16] = {
    [0] = (handler_t)(uintptr_t)stack_top,
    [1] = reset_handler,
    [2] = fault_handler,
    [3] = fault_handler,
    [16 + UART_RX_IRQ] = uart_rx_handler,
    [16 + UART_TX_IRQ] = uart_tx_handler,
    [16 + TIMER0_IRQ] = timer0_handler,
    [16 + TIMER1_IRQ] = timer1_handler,
};

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
