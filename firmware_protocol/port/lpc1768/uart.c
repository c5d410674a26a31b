/* UART0 to the host, both ways; UART2 from the GNSS receiver, one way. */

#include "gf_spec.h"
#include "port.h"

enum {
  EIGHT_BITS = 3,
  DIVISOR_ACCESS = 1 << 7,
  FIFO_ON = 1,
  FIFO_RESET = 6,
  TRIGGER_8 = 2 << 6,
  RECEIVE_INTERRUPT = 1,
  SEND_INTERRUPT = 2,
  HAS_DATA = 1 << 0, /* of LSR */
  HAS_ERROR = 7 << 1, /* overrun, parity, framing */
  CAN_SEND = 1 << 5,
  ALL_SENT = 1 << 6,
  FIFO_DEPTH = 16,
  HOST_PRIORITY = 0,
  GNSS_PRIORITY = 1 << 3,
  HOST_IN = 256,
  HOST_OUT = 4096,
  GNSS_IN = 512
};

typedef struct {
  uint32_t divisor;
  uint32_t fraction; /* of FDR */
} rate_t;

static volatile uint8_t host_in_bytes[HOST_IN];
static volatile uint8_t host_out_bytes[HOST_OUT];
static volatile uint8_t gnss_in_bytes[GNSS_IN];
static gf_ring_t host_in;
static gf_ring_t host_out;
static gf_ring_t gnss_in;
static volatile uint32_t host_errors;
static volatile uint32_t gnss_errors;
static volatile uint32_t sending;
static volatile uint32_t new_baud; /* 0: none is wanted */
static volatile uint32_t hold_at;  /* bytes ever written when it was wanted */

static uint32_t difference(uint32_t a, uint32_t b) { return a > b ? a - b : b - a; }

/*
 * User manual, 14.4.12: baud = PCLK / (16 * divisor * (1 + add / mul)).  1 and the nearest, or 0 when that is more than
 * 2 % off.
 */
static int find_rate(uint32_t baud, rate_t *rate) {
  const uint32_t sixteenth = CORE_HZ / 16;
  uint32_t best = UINT32_MAX; /* error in 1e-5 */
  for (uint32_t mul = 1; mul <= 15u; mul++) {
    for (uint32_t add = 0; add < mul; add++) {
      const uint32_t wanted = sixteenth * mul;
      const uint32_t unit = baud * (mul + add);
      const uint32_t divisor = (wanted + unit / 2u) / unit;
      const uint32_t off = difference(wanted, unit * divisor) / (wanted / 100000u);
      if (divisor >= (add != 0u ? 3u : 1u) && divisor <= 0xFFFFu && off < best) {
        best = off;
        rate->divisor = divisor;
        rate->fraction = (mul << 4) | add;
      }
    }
  }
  return best <= 2000u;
}

static void set_rate(lpc_uart_t *uart, uint32_t baud) {
  rate_t rate = {1, 0x10};
  const uint32_t primask = irq_save();
  (void)find_rate(baud, &rate);
  uart->LCR = DIVISOR_ACCESS | EIGHT_BITS;
  uart->DATA = rate.divisor & 0xFFu;
  uart->IER = rate.divisor >> 8;
  uart->FDR = rate.fraction;
  uart->LCR = EIGHT_BITS;
  irq_restore(primask);
}

void uart_start(void) {
  gf_ring_start(&host_in, host_in_bytes, HOST_IN);
  gf_ring_start(&host_out, host_out_bytes, HOST_OUT);
  gf_ring_start(&gnss_in, gnss_in_bytes, GNSS_IN);
  set_rate(LPC_UART0, GF_DEFAULT_BAUD);
  set_rate(LPC_UART2, GF_DEFAULT_GNSS_BAUD);
  LPC_UART0->FCR = FIFO_ON | FIFO_RESET | TRIGGER_8;
  LPC_UART2->FCR = FIFO_ON | FIFO_RESET; /* an interrupt for every byte */
  LPC_UART0->IER = RECEIVE_INTERRUPT | SEND_INTERRUPT;
  LPC_UART2->IER = RECEIVE_INTERRUPT;
  NVIC_PRIORITY[UART0_IRQ] = HOST_PRIORITY;
  NVIC_PRIORITY[UART2_IRQ] = GNSS_PRIORITY;
  NVIC_ISER0 = (1u << UART0_IRQ) | (1u << UART2_IRQ);
}

/* Fill the empty FIFO.  In the interrupt, or with interrupts off. */
static void feed(void) {
  uint8_t bytes[FIFO_DEPTH];
  uint32_t most = FIFO_DEPTH;
  size_t n;
  if (new_baud != 0u && hold_at - host_out.taken < most) {
    most = hold_at - host_out.taken;
  }
  n = gf_ring_take(&host_out, bytes, most);
  for (size_t i = 0; i < n; i++) {
    LPC_UART0->DATA = bytes[i];
  }
  sending = n != 0u;
}

static int host_write(void *context, const uint8_t *bytes, size_t size) {
  const int taken = gf_ring_put_all(&host_out, bytes, size);
  (void)context;
  if (taken && !sending) {
    const uint32_t primask = irq_save();
    if (!sending) {
      feed();
    }
    irq_restore(primask);
  }
  return taken;
}

static size_t ring_read(void *context, uint8_t *bytes, size_t size) { return gf_ring_take(context, bytes, size); }

static int no_write(void *context, const uint8_t *bytes, size_t size) {
  (void)context;
  (void)bytes;
  (void)size;
  return 0;
}

static int can_baud(void *context, uint32_t baud) {
  rate_t rate;
  (void)context;
  return find_rate(baud, &rate);
}

static void host_set_baud(void *context, uint32_t baud) {
  (void)context;
  hold_at = host_out.put;
  new_baud = baud;
}

static void gnss_set_baud(void *context, uint32_t baud) {
  (void)context;
  set_rate(LPC_UART2, baud);
}

void uart_service(void) {
  if (new_baud != 0u && !sending && host_out.taken == hold_at && (LPC_UART0->LSR & ALL_SENT) != 0u) {
    const uint32_t primask = irq_save();
    set_rate(LPC_UART0, new_baud);
    LPC_UART0->IER = RECEIVE_INTERRUPT | SEND_INTERRUPT;
    new_baud = 0;
    feed();
    irq_restore(primask);
  }
}

int uart_is_idle(void) { return gf_ring_used(&host_out) == 0u && (LPC_UART0->LSR & ALL_SENT) != 0u; }

int uart_has_input(void) { return gf_ring_used(&host_in) != 0u || gf_ring_used(&gnss_in) != 0u; }

static uint32_t host_count(void *context) {
  (void)context;
  return host_errors + host_in.lost;
}

static uint32_t gnss_count(void *context) {
  (void)context;
  return gnss_errors + gnss_in.lost;
}

gf_line_t uart_host(void) {
  const gf_line_t line = {&host_in, host_write, ring_read, can_baud, host_set_baud, host_count};
  return line;
}

gf_line_t uart_gnss(void) {
  const gf_line_t line = {&gnss_in, no_write, ring_read, can_baud, gnss_set_baud, gnss_count};
  return line;
}

/* Take everything that is there; returns the last line status. */
static uint32_t drain(lpc_uart_t *uart, gf_ring_t *ring, volatile uint32_t *errors) {
  uint32_t status = uart->LSR;
  while ((status & HAS_DATA) != 0u) {
    if ((status & HAS_ERROR) != 0u) {
      (*errors)++;
    }
    (void)gf_ring_put(ring, (uint8_t)(uart->DATA & 0xFFu));
    status = uart->LSR;
  }
  return status;
}

void uart0_handler(void) {
  (void)LPC_UART0->FCR; /* reading IIR ends a transmit interrupt */
  if ((drain(LPC_UART0, &host_in, &host_errors) & CAN_SEND) != 0u && sending) {
    feed();
  }
}

void uart2_handler(void) {
  (void)LPC_UART2->FCR;
  (void)drain(LPC_UART2, &gnss_in, &gnss_errors);
}
