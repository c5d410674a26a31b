#include "gf_adxl345.h"

enum {
  READ = 0x80,
  MULTIPLE = 0x40,
  FULL_RESOLUTION = 0x08,
  SELF_TEST = 0x80,
  MEASURE = 0x08,
  STREAM = 0x80,
  DATA_READY = 0x80,
  OVERRUN = 0x01,
  ENTRIES = 0x3F,
  SAMPLE_WORDS = 5,
  RATE_100_HZ = 0x0A,
  RATE_3200_HZ = 0x0F,
  MAX_BACKLOG = 2 /* values waiting in the FIFO; a sensor that runs faster than we read loses the oldest */
};

static uint16_t word(uint32_t high, uint32_t low) { return (uint16_t)((high << 8) | low); }

static int has(uint32_t mask, uint32_t i) { return ((mask >> i) & 1u) != 0u; }

static uint8_t without(uint32_t mask, uint32_t i) { return (uint8_t)(mask & ~(1u << i)); }

uint8_t gf_adxl345_rate_code(uint32_t rate_hz) {
  uint8_t code = RATE_3200_HZ;
  uint32_t next = 1600; /* the rate one code below */
  while (code > 0u && next >= rate_hz) {
    code--;
    next /= 2u;
  }
  return code;
}

uint8_t gf_adxl345_range_code(uint32_t range_g) {
  uint8_t code = 0;
  while (code < 3u && (2u << code) < range_g) {
    code++;
  }
  return code;
}

/* ---- registers of several sensors at once ---- */

static uint8_t write_register(const gf_adxl345_t *s, uint8_t mask, uint8_t address, uint8_t value) {
  const uint16_t out[1] = {word(address, value)};
  uint16_t in[GF_SPI_DEVICES][GF_SPI_WORDS];
  return s->spi->exchange(s->spi->context, mask, out, in, 1);
}

/* The sensors of the mask that show `wanted` there. */
static uint8_t showing(const gf_adxl345_t *s, uint8_t mask, uint8_t address, uint8_t wanted) {
  const uint16_t out[1] = {word((uint32_t)READ | address, 0)};
  uint16_t in[GF_SPI_DEVICES][GF_SPI_WORDS];
  uint8_t good = s->spi->exchange(s->spi->context, mask, out, in, 1);
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    if (has(good, i) && (in[i][0] & 0xFFu) != wanted) {
      good = without(good, i);
    }
  }
  return good;
}

/* Counts what had to answer and did not. */
static void count_missing(uint32_t *errors, uint8_t wanted, uint8_t good) {
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    if (has(wanted, i) && !has(good, i)) {
      errors[i]++;
    }
  }
}

static uint8_t start_sensors(gf_adxl345_t *s, uint8_t wanted) {
  uint8_t mask = showing(s, wanted, GF_ADXL345_DEVID, GF_ADXL345_IDENTITY);
  mask = write_register(s, mask, GF_ADXL345_POWER_CTL, 0);
  mask = write_register(s, mask, GF_ADXL345_DATA_FORMAT, s->format);
  mask = write_register(s, mask, GF_ADXL345_BW_RATE, s->rate_code);
  mask = write_register(s, mask, GF_ADXL345_FIFO_CTL, 0); /* bypass empties it */
  mask = write_register(s, mask, GF_ADXL345_FIFO_CTL, s->fifo);
  mask = write_register(s, mask, GF_ADXL345_INT_ENABLE, 0);
  mask = write_register(s, mask, GF_ADXL345_POWER_CTL, MEASURE);
  mask = showing(s, mask, GF_ADXL345_DATA_FORMAT, s->format);
  mask = showing(s, mask, GF_ADXL345_BW_RATE, s->rate_code);
  count_missing(s->init_errors, wanted, mask);
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    if (has(mask, i)) {
      s->failures[i] = 0;
      s->same[i] = 0;
    }
  }
  s->alive = (uint8_t)(s->alive | mask);
  return s->alive;
}

uint8_t gf_adxl345_start(gf_adxl345_t *s, uint32_t rate_hz, uint32_t range_g, int fifo) {
  s->format = (uint8_t)((uint32_t)FULL_RESOLUTION | gf_adxl345_range_code(range_g));
  s->rate_code = gf_adxl345_rate_code(rate_hz);
  s->fifo = fifo ? STREAM : 0;
  s->alive = 0;
  return start_sensors(s, (1u << GF_SPI_DEVICES) - 1u);
}

uint8_t gf_adxl345_start_missing(gf_adxl345_t *s) {
  const uint8_t missing = (uint8_t)(~(uint32_t)s->alive & ((1u << GF_SPI_DEVICES) - 1u));
  return missing == 0u ? s->alive : start_sensors(s, missing);
}

/* ---- samples ---- */

/* X0 X1 Y0 Y1 Z0 Z1 lie one byte behind the words: each value is a low byte and the high byte of the next word. */
static int16_t value(const uint16_t *words, uint32_t axis) {
  const uint16_t low = words[axis + 1u];
  const uint16_t high = words[axis + 2u];
  return (int16_t)(uint16_t)((low & 0xFFu) | (high & 0xFF00u));
}

/* One sensor's answer into counts; 1 when the value is new. */
static int take(gf_adxl345_t *s, uint32_t i, const uint16_t *words) {
  const uint32_t source = words[0] & 0xFFu;
  int equal = 1;
  if ((source & OVERRUN) != 0u) {
    s->overruns[i]++;
  }
  if ((source & DATA_READY) == 0u) {
    return 0;
  }
  for (uint32_t axis = 0; axis < 3u; axis++) {
    const int16_t now = value(words, axis);
    equal = equal && s->counts[3u * i + axis] == now;
    s->counts[3u * i + axis] = now;
  }
  if (!equal) {
    s->same[i] = 0;
  } else if (s->same[i] < GF_ADXL345_STUCK_AFTER) {
    s->same[i]++;
  } else {
    return 0; /* a value that never moves is not measured */
  }
  return 1;
}

static void fail(gf_adxl345_t *s, uint32_t i) {
  s->spi_errors[i]++;
  s->failures[i]++;
  if (s->failures[i] >= GF_ADXL345_DEAD_AFTER) {
    s->alive = without(s->alive, i);
  }
}

/* Read the sensors of the mask once; returns those with a new value.  Those that fail are counted. */
static uint8_t read_once(gf_adxl345_t *s, uint8_t mask) {
  static const uint16_t out[SAMPLE_WORDS] = {((uint32_t)READ | MULTIPLE | GF_ADXL345_INT_SOURCE) << 8, 0, 0, 0, 0};
  uint16_t in[GF_SPI_DEVICES][GF_SPI_WORDS];
  const uint8_t answered = s->spi->exchange(s->spi->context, mask, out, in, SAMPLE_WORDS);
  uint8_t fresh = 0;
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    if (!has(mask, i)) {
      continue;
    }
    if (!has(answered, i) || (in[i][1] >> 8) != s->format || (in[i][4] & 0xFFu) != s->fifo) {
      fail(s, i);
    } else {
      s->failures[i] = 0;
      if (take(s, i, in[i])) {
        fresh = (uint8_t)(fresh | (1u << i));
      }
    }
  }
  return fresh;
}

/* The sensors of the mask whose FIFO holds more than we let wait. */
static uint8_t behind(const gf_adxl345_t *s, uint8_t mask) {
  static const uint16_t out[1] = {((uint32_t)READ | GF_ADXL345_FIFO_STATUS) << 8};
  uint16_t in[GF_SPI_DEVICES][GF_SPI_WORDS];
  uint8_t full = s->spi->exchange(s->spi->context, mask, out, in, 1);
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    if (has(full, i) && (in[i][0] & ENTRIES) <= MAX_BACKLOG) {
      full = without(full, i);
    }
  }
  return full;
}

uint8_t gf_adxl345_read(gf_adxl345_t *s) {
  const uint8_t fresh = read_once(s, s->alive);
  if (s->fifo != 0u) {
    uint8_t late;
    s->spi->pause(s->spi->context);
    late = behind(s, (uint8_t)(fresh & s->alive));
    if (late != 0u) {
      (void)read_once(s, late);
    }
  }
  return (uint8_t)(~(uint32_t)fresh & ((1u << GF_SPI_DEVICES) - 1u));
}

/* ---- self-test ---- */

/* Data sheet, table of the self-test response in full resolution, widened to 2.0 .. 3.6 V. */
static int is_response(const int16_t change[3]) {
  return change[0] >= 50 && change[0] <= 960 && change[1] <= -50 && change[1] >= -960 && change[2] >= 75 &&
         change[2] <= 1290;
}

void gf_adxl345_test_start(gf_adxl345_t *s, gf_adxl345_test_t *test) {
  (void)gf_adxl345_start(s, 100, 16, 0);
  test->samples = 0;
  test->tested = s->alive;
  test->passed = 0;
  for (uint32_t i = 0; i < 12u; i++) {
    test->rest[i] = 0;
    test->bent[i] = 0;
    test->change[i] = 0;
  }
}

static void judge(gf_adxl345_test_t *test) {
  for (uint32_t i = 0; i < 12u; i++) {
    test->change[i] = (int16_t)((test->bent[i] - test->rest[i]) / GF_ADXL345_TEST_MEAN);
  }
  for (size_t i = 0; i < GF_SPI_DEVICES; i++) {
    if (has(test->tested, (uint32_t)i) && is_response(&test->change[3u * i])) {
      test->passed = (uint8_t)(test->passed | (1u << i));
    }
  }
}

int gf_adxl345_test_step(gf_adxl345_t *s, gf_adxl345_test_t *test) {
  const uint32_t half = (uint32_t)GF_ADXL345_TEST_SETTLE + (uint32_t)GF_ADXL345_TEST_MEAN;
  const uint32_t within = test->samples % half;
  const int bent = test->samples >= half;
  (void)gf_adxl345_read(s);
  test->tested = (uint8_t)(test->tested & s->alive);
  if (within >= GF_ADXL345_TEST_SETTLE) {
    int32_t *sums = bent ? test->bent : test->rest;
    for (uint32_t i = 0; i < 12u; i++) {
      sums[i] += s->counts[i];
    }
  }
  test->samples++;
  if (test->samples == half) {
    s->format = (uint8_t)(s->format | SELF_TEST);
    (void)write_register(s, test->tested, GF_ADXL345_DATA_FORMAT, s->format);
  }
  if (test->samples < 2u * half) {
    return 0;
  }
  judge(test);
  return 1;
}
