/* The board on an LPC1768. */

#include "gf_board.h"
#include "port.h"

extern const uint8_t firmware_id[20]; /* made by the Makefile */

static gf_board_t board;
static volatile uint32_t reboot_wanted;

static void reboot(void *context) {
  (void)context;
  reboot_wanted = 1;
}

static uint32_t free_stack(void *context) {
  (void)context;
  return port_free_stack();
}

void port_tick(uint64_t ticks, uint32_t missed) { gf_board_tick(&board, ticks, missed); }

static void start_board(void) {
  static const uint8_t buses[GF_SENSORS] = {0, 0, 1, 1};
  gf_port_t *port = &board.port;
  port->spi.exchange = spi_exchange;
  port->spi.pause = spi_pause;
  port->adc.read = adc_read;
  port->host = uart_host();
  port->gnss = uart_gnss();
  port->tacho = time_tacho();
  port->pps = time_pps();
  port->tick_hz = CORE_HZ;
  port->now = time_now;
  port->set_period = time_set_period;
  port->idle_ticks = time_idle;
  port->free_stack = free_stack;
  port->reboot = reboot;
  system_uid(port->uid);
  for (uint32_t i = 0; i < sizeof port->firmware; i++) {
    port->firmware[i] = firmware_id[i];
  }
  port->epoch = system_next_epoch();
  port->simulated = system_is_simulated() ? 1u : 0u;
  for (uint32_t i = 0; i < GF_SENSORS; i++) {
    port->bus_of[i] = buses[i];
  }
  gf_board_start(&board);
}

/* At least every 10 ms, as the timer's rounds make the main loop turn. */
static void feed_watchdog(void) {
  static uint64_t next;
  const uint64_t now = time_now(NULL);
  if (now >= next) {
    next = now + CORE_HZ / 100;
    watchdog_feed();
  }
}

/* Nothing to do; interrupts are off, so that nothing comes between this look and the sleep. */
static int is_idle(void) { return board.put == board.taken && !uart_has_input() && !time_has_news(); }

void port_main(void) {
  irq_off();
  watchdog_start(); /* first: it counts its own oscillator and starts a board anew whose crystal did not */
  system_start();
  time_start();
  spi_start();
  uart_start();
  irq_on();
  start_board();
  for (;;) {
    feed_watchdog();
    gf_board_step(&board);
    uart_service();
    system_leds(1, board.sensors.alive != 0xFu);
    if (reboot_wanted != 0u && uart_is_idle()) {
      port_reset();
    }
    irq_off();
    while (is_idle()) {
      time_sleep();
      irq_on(); /* the interrupt that ended it runs here */
      __asm volatile("isb" ::: "memory");
      irq_off();
    }
    irq_on();
  }
}
