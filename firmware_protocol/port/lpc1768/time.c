/* TIMER2: the time base, the sampling instants, the captures.  Counts CCLK, never stopped, wraps every 44.7 s. */

#include "port.h"

enum {
  INSTANT = 1 << 0, /* of IR: match 0 */
  ROUND = 1 << 1,   /* match 1 */
  TACHO = 1 << 4,   /* capture 0 */
  PPS = 1 << 5,     /* capture 1 */
  INSTANT_INTERRUPT = 1 << 0, /* of MCR */
  ROUND_INTERRUPT = 1 << 3,
  CAPTURE_BOTH_RISING = (1 << 0) | (1 << 2) | (1 << 3) | (1 << 5),
  ROUND_TICKS = CORE_HZ / 100, /* the main loop turns at least this often */
  TOO_LATE = 200,              /* a match closer than this might be passed before it is set */
  STRAP_DIRECTION = 1 << 1,
  DIRECTION = 1 << 2,
  EDGE_RISING = 1,
  EDGE_DIRECTION_KNOWN = 2,
  EDGE_NEGATIVE = 4,
  TIMER_PRIORITY = 2 << 3
};

static uint32_t period;  /* ticks between instants */
static uint32_t carried; /* instants missed, not yet told */
static volatile uint32_t last;
static volatile uint32_t wraps;
static volatile uint32_t news;
static uint64_t idle;
static uint32_t has_direction;
static gf_pulses_t tacho;
static gf_pulses_t pps;

uint64_t time_now(void *context) {
  const uint32_t primask = irq_save();
  const uint32_t count = LPC_TIMER2->TC;
  uint64_t ticks;
  (void)context;
  if (count < last) {
    wraps++;
  }
  last = count;
  ticks = ((uint64_t)wraps << 32) | count;
  irq_restore(primask);
  return ticks;
}

/* A count of the last 44 s as ticks since boot. */
static uint64_t extend(uint64_t now, uint32_t count) { return now - (uint32_t)((uint32_t)now - count); }

void time_start(void) {
  has_direction = (LPC_GPIO2->PIN & STRAP_DIRECTION) == 0u;
  LPC_TIMER2->PR = 0;
  LPC_TIMER2->MCR = ROUND_INTERRUPT;
  LPC_TIMER2->CCR = CAPTURE_BOTH_RISING;
  LPC_TIMER2->TCR = 1;
  LPC_TIMER2->MR[1] = LPC_TIMER2->TC + ROUND_TICKS;
  NVIC_PRIORITY[TIMER2_IRQ] = TIMER_PRIORITY;
  NVIC_ISER0 = 1u << TIMER2_IRQ;
}

void time_set_period(void *context, uint32_t ticks) {
  const uint32_t primask = irq_save();
  (void)context;
  period = ticks;
  carried = 0;
  if (ticks == 0u) {
    LPC_TIMER2->MCR = ROUND_INTERRUPT;
  } else {
    LPC_TIMER2->MR[0] = LPC_TIMER2->TC + ticks;
    LPC_TIMER2->MCR = ROUND_INTERRUPT | INSTANT_INTERRUPT;
  }
  LPC_TIMER2->IR = INSTANT;
  irq_restore(primask);
}

static void serve_instant(uint64_t now) {
  const uint32_t match = LPC_TIMER2->MR[0];
  const uint32_t told = carried;
  uint32_t next = match + period;
  carried = 0;
  while ((int32_t)(next - LPC_TIMER2->TC) < TOO_LATE) {
    next += period;
    carried++;
  }
  LPC_TIMER2->MR[0] = next;
  port_tick(extend(now, match), told);
}

static uint8_t tacho_edge(void) {
  uint32_t edge = EDGE_RISING;
  if (has_direction != 0u) {
    edge |= EDGE_DIRECTION_KNOWN;
    edge |= (LPC_GPIO2->PIN & DIRECTION) == 0u ? (uint32_t)EDGE_NEGATIVE : 0u;
  }
  return (uint8_t)edge;
}

void timer2_handler(void) {
  const uint32_t why = LPC_TIMER2->IR;
  const uint64_t now = time_now(NULL);
  LPC_TIMER2->IR = why;
  if ((why & TACHO) != 0u) {
    gf_pulses_put(&tacho, extend(now, LPC_TIMER2->CR[0]), tacho_edge());
    news = 1;
  }
  if ((why & PPS) != 0u) {
    gf_pulses_put(&pps, extend(now, LPC_TIMER2->CR[1]), EDGE_RISING);
    news = 1;
  }
  if ((why & ROUND) != 0u) {
    LPC_TIMER2->MR[1] = LPC_TIMER2->TC + ROUND_TICKS;
    news = 1;
  }
  if ((why & INSTANT) != 0u && period != 0u) {
    serve_instant(now);
  }
}

void time_sleep(void) {
  const uint32_t from = LPC_TIMER2->TC;
  wait_for_interrupt();
  idle += (uint32_t)(LPC_TIMER2->TC - from);
}

uint64_t time_idle(void *context) {
  (void)context;
  return idle;
}

int time_has_news(void) {
  const int had = news != 0u;
  news = 0;
  return had;
}

gf_capture_t time_tacho(void) {
  const gf_capture_t capture = {&tacho, gf_pulses_next, gf_pulses_overflows};
  return capture;
}

gf_capture_t time_pps(void) {
  const gf_capture_t capture = {&pps, gf_pulses_next, gf_pulses_overflows};
  return capture;
}
