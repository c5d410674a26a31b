/*
 * libFuzzer: a whole board with any commands from its host.  The first byte of each record says what comes: commands of
 * well-formed frames, raw bytes, time.  Sensors answer with noise made from the input.  Settings stay within their limits.
 */
#include <stdlib.h>
#include <string.h>

#include "gf_board.h"
#include "gf_ring.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static gf_board_t board;
static gf_ring_t ring;
static volatile uint8_t ring_bytes[1024];
static uint64_t ticks;
static uint32_t period;
static uint32_t noise;

static void demand(int holds) {
  if (!holds) {
    abort();
  }
}

static uint8_t exchange(void *context, uint8_t mask, const uint16_t *out, uint16_t in[][GF_SPI_WORDS], uint8_t n) {
  const uint32_t address = (uint32_t)(out[0] >> 8) & 0x3Fu;
  (void)context;
  demand(n >= 1u && n <= GF_SPI_WORDS && mask < 16u);
  for (uint32_t i = 0; i < 4u; i++) {
    for (uint32_t word = 0; word < n && ((uint32_t)mask >> i & 1u) != 0u; word++) {
      noise = noise * 1664525u + 1013904223u;
      in[i][word] = (uint16_t)(noise >> 16);
    }
    if (((uint32_t)mask >> i & 1u) == 0u || (noise & 0x30000u) == 0u) {
      continue; /* now and then a sensor answers nonsense */
    }
    if (address == GF_ADXL345_DEVID) {
      in[i][0] = GF_ADXL345_IDENTITY;
    } else if (address == GF_ADXL345_DATA_FORMAT) {
      in[i][0] = board.sensors.format;
    } else if (address == GF_ADXL345_BW_RATE) {
      in[i][0] = board.sensors.rate_code;
    } else if (n == 5u) {
      in[i][1] = (uint16_t)((in[i][1] & 0xFFu) | (uint32_t)board.sensors.format << 8);
      in[i][4] = (uint16_t)((in[i][4] & 0xFF00u) | board.sensors.fifo);
    }
  }
  return mask;
}

static void nothing(void *context) { (void)context; }

static uint8_t read_adc(void *context, uint8_t mask, uint16_t *values) {
  (void)context;
  values[0] = (uint16_t)noise;
  return (uint8_t)(mask & noise);
}

static uint64_t now(void *context) {
  (void)context;
  return ticks;
}

static void set_period(void *context, uint32_t wanted) {
  (void)context;
  demand(wanted == 0u || (wanted >= 30000u && wanted <= 96000000u));
  period = wanted;
}

static uint32_t zero(void *context) {
  (void)context;
  return 0;
}

static int host_write(void *context, const uint8_t *bytes, size_t size) {
  (void)context;
  demand(size >= 2u && size <= GF_MAX_WIRE && bytes[0] == 0u && bytes[size - 1u] == 0u);
  return (noise & 7u) != 0u;
}

static size_t host_read(void *context, uint8_t *bytes, size_t size) { return gf_ring_take(context, bytes, size); }

static int can_baud(void *context, uint32_t baud) {
  (void)context;
  return (baud & 1u) == 0u;
}

static void set_baud(void *context, uint32_t baud) {
  (void)context;
  demand(baud >= 4800u && baud <= 3000000u);
}

static int no_pulse(void *context, gf_pulse_t *pulse) {
  (void)context;
  (void)pulse;
  return 0;
}

static void start(void) {
  const gf_line_t line = {&ring, host_write, host_read, can_baud, set_baud, zero};
  static gf_ring_t none;
  memset(&board, 0, sizeof board);
  gf_ring_start(&ring, ring_bytes, sizeof ring_bytes);
  gf_ring_start(&none, ring_bytes, sizeof ring_bytes);
  ticks = 0;
  noise = 1;
  board.port.spi.exchange = exchange;
  board.port.spi.pause = nothing;
  board.port.adc.read = read_adc;
  board.port.host = line;
  board.port.gnss = line;
  board.port.gnss.context = &none;
  board.port.tacho.next = no_pulse;
  board.port.tacho.overflows = zero;
  board.port.pps = board.port.tacho;
  board.port.tick_hz = 96000000;
  board.port.now = now;
  board.port.set_period = set_period;
  board.port.idle_ticks = now;
  board.port.free_stack = zero;
  board.port.reboot = nothing;
  gf_board_start(&board);
}

static void feed(const uint8_t *bytes, size_t size) {
  (void)gf_ring_put_all(&ring, bytes, size);
  gf_board_step(&board);
}

static void run(uint32_t instants) {
  for (uint32_t i = 0; i < instants && period != 0u; i++) {
    ticks += period;
    gf_board_tick(&board, ticks, noise & 1u);
    gf_board_step(&board);
  }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  size_t at = 0;
  start();
  while (at + 2u <= size) {
    const uint8_t what = data[at];
    const size_t left = size - at - 2u;
    const size_t n = data[at + 1u] < left ? data[at + 1u] : left;
    const uint8_t *bytes = data + at + 2u;
    if (what < 160u) {
      uint8_t wire[GF_MAX_WIRE];
      const gf_header_t header = {GF_TYPE_CMD, 0, 0, what, 0};
      feed(wire, gf_encode(wire, sizeof wire, &header, bytes, n));
    } else if (what < 200u) {
      feed(bytes, n);
    } else {
      run(what - 200u);
    }
    at += 2u + n;
    demand(board.batch >= 1u && board.batch <= GF_ACC12_MAX_ROWS && board.acc.n <= board.batch);
    demand(gf_setting(&board.settings, GF_SET_RATE_HZ) - 1u < 3200u && gf_setting(&board.settings, GF_SET_FIFO) < 2u);
    demand(board.sender.built == board.sender.sent + board.sender.dropped);
  }
  return 0;
}
