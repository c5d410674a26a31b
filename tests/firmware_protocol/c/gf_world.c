/*
 * The board's logic and drivers in a world of models, told on stdin what happens; what the host receives is printed.
 *
 *   run <us>            time goes on          host <hex>      bytes from the host      gnss <hex>     from the receiver
 *   fault <i> <name>    none dead low stuck wrong-id silent refused reset slow
 *   ppm <i> <ppm>       a sensor's own clock  stall <0|1>     the host's line takes nothing
 *   pulse <edge>        tachometer, now       pps             pulse per second, now
 *   analog <i> <count>  a channel             late <us>       the next instant is served so late
 *   boot                print what is written so far at "W <hex>" lines, after every run
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gf_board.h"
#include "gf_ring.h"

enum { HZ = 96000000, PER_US = 96, FIFO_DEPTH = 32, ROUND = HZ / 100 };

typedef struct {
  uint8_t regs[64];
  char fault[16];
  int64_t ppm;
  uint64_t next; /* ticks of the next conversion, in 1e-3 */
  uint32_t made; /* conversions */
  int16_t fifo[FIFO_DEPTH][3];
  uint32_t entries;
  int unread;
  int overrun;
} adxl_t;

static gf_board_t board;
static adxl_t sensors[4];
static uint64_t clock_ticks;
static uint64_t next_instant;
static uint32_t period;
static uint32_t late_us;
static int stalled;
static int rebooted;
static uint32_t baud = GF_DEFAULT_BAUD;
static uint16_t analog[8];
static uint8_t analog_fresh;
static gf_pulses_t pulses;
static gf_pulses_t seconds;
static gf_ring_t host_in;
static gf_ring_t gnss_in;
static volatile uint8_t host_bytes[1024];
static volatile uint8_t gnss_bytes[1024];

static int is(const adxl_t *s, const char *fault) { return strcmp(s->fault, fault) == 0; }

static void power_on(adxl_t *s) {
  memset(s->regs, 0, sizeof s->regs);
  s->regs[0] = 0xE5;
  s->regs[GF_ADXL345_BW_RATE] = 0x0A;
  s->entries = 0;
  s->unread = 0;
  s->overrun = 0;
}

static int in_stream(const adxl_t *s) { return (s->regs[GF_ADXL345_FIFO_CTL] & 0xC0) == 0x80; }

/* 1 g on z, a ripple, in full resolution: 3.9 mg per count whatever the range. */
static void convert(adxl_t *s, uint32_t i) {
  const int16_t ripple = (int16_t)(s->made % 5u) - 2;
  int16_t xyz[3] = {(int16_t)(10 * (int)i + ripple), (int16_t)(-20 - (int)i), (int16_t)(256 + ripple)};
  if (s->regs[GF_ADXL345_DATA_FORMAT] & 0x80) {
    xyz[0] = (int16_t)(xyz[0] + 300);
    xyz[1] = (int16_t)(xyz[1] - 300);
    xyz[2] = (int16_t)(xyz[2] + 400);
  }
  if (is(s, "stuck")) {
    xyz[0] = xyz[1] = xyz[2] = 77;
  }
  s->made++;
  if (in_stream(s)) {
    if (s->entries == FIFO_DEPTH) {
      memmove(s->fifo[0], s->fifo[1], sizeof s->fifo - sizeof s->fifo[0]);
      s->entries--;
      s->overrun = 1;
    }
    memcpy(s->fifo[s->entries], xyz, sizeof xyz);
    s->entries++;
  } else {
    s->overrun = s->overrun || s->unread;
    memcpy(s->fifo[0], xyz, sizeof xyz);
    s->unread = 1;
  }
}

static uint64_t odr_period_milliticks(const adxl_t *s) {
  const uint32_t code = s->regs[GF_ADXL345_BW_RATE] & 15u;
  const int64_t nominal = (int64_t)HZ * 1000 / 3200 << (15u - code);
  return (uint64_t)(nominal - nominal * s->ppm / 1000000);
}

static void sensors_until(uint64_t ticks) {
  for (uint32_t i = 0; i < 4u; i++) {
    adxl_t *s = &sensors[i];
    while (s->next <= ticks * 1000u) {
      if ((s->regs[GF_ADXL345_POWER_CTL] & 8) && !is(s, "silent")) {
        convert(s, i);
      }
      s->next += odr_period_milliticks(s);
    }
  }
}

static uint8_t read_register(adxl_t *s, uint32_t address) {
  const int ready = in_stream(s) ? s->entries != 0u : s->unread;
  switch (address) {
    case GF_ADXL345_DEVID:
      return is(s, "wrong-id") ? 0x1D : 0xE5;
    case GF_ADXL345_INT_SOURCE:
      return (uint8_t)((ready ? 0x80 : 0) | (s->overrun ? 1 : 0));
    case GF_ADXL345_FIFO_STATUS:
      return (uint8_t)s->entries;
    default:
      break;
  }
  if (address >= GF_ADXL345_DATAX0 && address < GF_ADXL345_DATAX0 + 6u) {
    const uint32_t at = address - GF_ADXL345_DATAX0;
    return (uint8_t)((uint16_t)s->fifo[0][at / 2u] >> (8u * (at % 2u)));
  }
  return s->regs[address & 63u];
}

static void data_was_read(adxl_t *s) {
  s->unread = 0;
  s->overrun = 0;
  if (in_stream(s) && s->entries != 0u) {
    memmove(s->fifo[0], s->fifo[1], sizeof s->fifo - sizeof s->fifo[0]);
    s->entries--;
  }
}

static void transfer(adxl_t *s, const uint16_t *out, uint16_t *in, uint8_t n) {
  const uint8_t command = (uint8_t)(out[0] >> 8);
  uint32_t address = command & 0x3Fu;
  int data = 0;
  memset(in, is(s, "dead") ? 0xFF : 0, n * sizeof *in);
  if (is(s, "dead") || is(s, "low")) {
    return;
  }
  if (!(command & 0x80)) {
    if (!is(s, "reset")) {
      s->regs[address] = (uint8_t)out[0];
    }
    if (address == GF_ADXL345_FIFO_CTL && !in_stream(s)) {
      s->entries = 0;
      s->unread = 0;
      s->overrun = 0;
    }
    return;
  }
  for (uint32_t byte = 1; byte < 2u * n; byte++) {
    const uint8_t value = read_register(s, address);
    in[byte / 2u] = (uint16_t)(in[byte / 2u] | value << (byte % 2u ? 0 : 8));
    data = data || address == GF_ADXL345_DATAX0 + 5u;
    address += (command & 0x40) ? 1u : 0u;
  }
  if (data) {
    data_was_read(s);
  }
}

static uint8_t exchange(void *context, uint8_t mask, const uint16_t *out, uint16_t in[][GF_SPI_WORDS], uint8_t n) {
  uint32_t done = mask;
  (void)context;
  sensors_until(clock_ticks);
  for (uint32_t i = 0; i < 4u; i++) {
    if (((uint32_t)mask >> i) & 1u) {
      transfer(&sensors[i], out, in[i], n);
      if (is(&sensors[i], "refused")) {
        done &= ~(1u << i);
      }
    }
  }
  return (uint8_t)done;
}

static void no_pause(void *context) { (void)context; }

static uint8_t read_analog(void *context, uint8_t mask, uint16_t *values) {
  (void)context;
  memcpy(values, analog, sizeof analog);
  return analog_fresh & mask;
}

static uint64_t now(void *context) {
  (void)context;
  return clock_ticks;
}

static void set_period(void *context, uint32_t ticks) {
  (void)context;
  period = ticks;
  next_instant = clock_ticks + ticks;
}

static uint64_t idle(void *context) {
  (void)context;
  return clock_ticks / 4u * 3u;
}

static uint32_t stack(void *context) {
  (void)context;
  return 4321;
}

static void reboot(void *context) {
  (void)context;
  rebooted = 1;
}

static int host_write(void *context, const uint8_t *bytes, size_t size) {
  (void)context;
  if (stalled) {
    return 0;
  }
  printf("W ");
  for (size_t i = 0; i < size; i++) {
    printf("%02x", bytes[i]);
  }
  printf("\n");
  return 1;
}

static size_t ring_read(void *context, uint8_t *bytes, size_t size) { return gf_ring_take(context, bytes, size); }

static int can_baud(void *context, uint32_t wanted) {
  (void)context;
  return wanted != 1234567u;
}

static void set_baud(void *context, uint32_t wanted) {
  (void)context;
  baud = wanted;
  printf("B %lu\n", (unsigned long)baud);
}

static uint32_t errors(void *context) {
  const gf_ring_t *ring = context;
  return ring->lost;
}

static void start(void) {
  gf_port_t *port = &board.port;
  const gf_line_t host = {&host_in, host_write, ring_read, can_baud, set_baud, errors};
  const gf_line_t gnss = {&gnss_in, host_write, ring_read, can_baud, set_baud, errors};
  gf_ring_start(&host_in, host_bytes, sizeof host_bytes);
  gf_ring_start(&gnss_in, gnss_bytes, sizeof gnss_bytes);
  port->spi.exchange = exchange;
  port->spi.pause = no_pause;
  port->adc.read = read_analog;
  port->host = host;
  port->gnss = gnss;
  port->tacho.context = &pulses;
  port->tacho.next = gf_pulses_next;
  port->tacho.overflows = gf_pulses_overflows;
  port->pps = port->tacho;
  port->pps.context = &seconds;
  port->tick_hz = HZ;
  port->now = now;
  port->set_period = set_period;
  port->idle_ticks = idle;
  port->free_stack = stack;
  port->reboot = reboot;
  port->epoch = 7;
  port->simulated = 1;
  port->uid[0] = 0xAB;
  port->firmware[0] = 0xCD;
  port->bus_of[2] = port->bus_of[3] = 1;
  for (uint32_t i = 0; i < 4u; i++) {
    power_on(&sensors[i]);
    sensors[i].next = (i + 1u) * 1000u;
  }
}

static void instant(void) {
  uint32_t missed = 0;
  const uint64_t at = next_instant;
  static uint32_t told;
  clock_ticks = next_instant + (uint64_t)late_us * PER_US;
  late_us = 0;
  next_instant += period;
  while (next_instant <= clock_ticks) {
    next_instant += period;
    missed++;
  }
  gf_board_tick(&board, at, told);
  told = missed;
}

static void run(uint64_t us) {
  const uint64_t end = clock_ticks + us * PER_US;
  uint64_t round = clock_ticks;
  while (clock_ticks < end) {
    if (period != 0u && next_instant <= round && next_instant <= end) {
      instant();
    } else if (round < end) {
      clock_ticks = round > clock_ticks ? round : clock_ticks;
      round += ROUND;
    } else {
      clock_ticks = end;
    }
    gf_board_step(&board);
  }
}

static void bytes_in(gf_ring_t *ring, const char *hex) {
  unsigned byte;
  for (; sscanf(hex, "%2x", &byte) == 1; hex += 2) {
    (void)gf_ring_put(ring, (uint8_t)byte);
  }
}

static void obey(const char *word, const char *text, long a) {
  if (strcmp(word, "boot") == 0) {
    gf_board_start(&board);
  } else if (strcmp(word, "run") == 0) {
    run((uint64_t)a);
    if (rebooted) {
      printf("R\n");
      rebooted = 0;
    }
  } else if (strcmp(word, "host") == 0) {
    bytes_in(&host_in, text);
  } else if (strcmp(word, "gnss") == 0) {
    bytes_in(&gnss_in, text);
  } else if (strcmp(word, "stall") == 0) {
    stalled = (int)a;
  } else if (strcmp(word, "late") == 0) {
    late_us = (uint32_t)a;
  } else if (strcmp(word, "pulse") == 0) {
    gf_pulses_put(&pulses, clock_ticks, (uint8_t)a);
  } else if (strcmp(word, "pps") == 0) {
    gf_pulses_put(&seconds, clock_ticks + 48u, 1);
  } else {
    char name[16] = "";
    long i = 0;
    if (sscanf(text, "%ld %15s", &i, name) != 2 || i < 0 || i > 7) {
      exit(2);
    }
    if (strcmp(word, "fault") == 0 && i < 4) {
      memcpy(sensors[i].fault, name, sizeof name);
      if (strcmp(name, "reset") == 0) {
        power_on(&sensors[i]);
      }
    } else if (strcmp(word, "ppm") == 0 && i < 4) {
      sensors[i].ppm = atol(name);
    } else if (strcmp(word, "analog") == 0) {
      analog[i] = (uint16_t)atol(name);
      analog_fresh = (uint8_t)(analog_fresh | 1u << i);
    } else {
      exit(2);
    }
  }
}

int main(void) {
  static char line[4096];
  start();
  while (fgets(line, sizeof line, stdin) != NULL) {
    char word[16] = "";
    if (sscanf(line, "%15s", word) == 1) {
      const char *text = line + strlen(word);
      obey(word, text[0] == ' ' ? text + 1 : text, atol(text));
    }
  }
  return 0;
}
