#ifndef GF_ADXL345_H
#define GF_ADXL345_H

/*
 * Four ADXL345 behind one SPI bus of gf_bus.h: start, read, watch over, start again, self-test.
 *
 * All four get the same settings.  They run on their own clocks and are never sampled at one instant: stale_mask says
 * which gave no new value.  A sensor is believed only while it shows the settings it was given, in every sample.
 */

#include "gf_bus.h"

enum {
  GF_ADXL345_DEVID = 0x00,
  GF_ADXL345_BW_RATE = 0x2C,
  GF_ADXL345_POWER_CTL = 0x2D,
  GF_ADXL345_INT_ENABLE = 0x2E,
  GF_ADXL345_INT_SOURCE = 0x30,
  GF_ADXL345_DATA_FORMAT = 0x31,
  GF_ADXL345_DATAX0 = 0x32,
  GF_ADXL345_FIFO_CTL = 0x38,
  GF_ADXL345_FIFO_STATUS = 0x39,
  GF_ADXL345_IDENTITY = 0xE5,
  GF_ADXL345_SCALE_NG = 3900000, /* per count, full resolution, every range */
  GF_ADXL345_DEAD_AFTER = 8,     /* failed samples in a row */
  GF_ADXL345_STUCK_AFTER = 128,  /* equal samples in a row: its noise is about one count */
  GF_ADXL345_TEST_SETTLE = 8,    /* samples thrown away after the deflection changed */
  GF_ADXL345_TEST_MEAN = 32      /* samples averaged, each way */
};

typedef struct {
  const gf_spi_t *spi;
  uint8_t alive; /* bit i: sensor i is started and shows its settings */
  uint8_t format; /* DATA_FORMAT as written */
  uint8_t rate_code;
  uint8_t fifo; /* FIFO_CTL as written */
  int16_t counts[12]; /* the newest, sensor 0 x y z, sensor 1 x y z, ... */
  uint8_t failures[GF_SPI_DEVICES]; /* in a row */
  uint8_t same[GF_SPI_DEVICES];     /* equal samples in a row */
  uint32_t spi_errors[GF_SPI_DEVICES];
  uint32_t init_errors[GF_SPI_DEVICES];
  uint32_t overruns[GF_SPI_DEVICES];
} gf_adxl345_t;

/* BW_RATE code of the lowest output rate at or above rate_hz (at most 3200). */
uint8_t gf_adxl345_rate_code(uint32_t rate_hz);

/* Range code of 2, 4, 8 or 16 g. */
uint8_t gf_adxl345_range_code(uint32_t range_g);

/* Give these settings to every sensor and start it.  Returns the mask of those that answered; see start_missing. */
uint8_t gf_adxl345_start(gf_adxl345_t *sensors, uint32_t rate_hz, uint32_t range_g, int fifo);

/* Try those that are not alive once more.  A failure counts in init_errors. */
uint8_t gf_adxl345_start_missing(gf_adxl345_t *sensors);

/*
 * Take a sample into `counts`.  Returns the mask of sensors whose value is old: dead, failed, no new value, or stuck.  Takes
 * 40 us on the LPC1768.
 */
uint8_t gf_adxl345_read(gf_adxl345_t *sensors);

typedef struct {
  uint16_t samples; /* so far */
  int32_t rest[12]; /* sums */
  int32_t bent[12];
  uint8_t tested; /* sensors that answered all the time */
  uint8_t passed;
  int16_t change[12]; /* counts */
} gf_adxl345_test_t;

/* Begin a self-test: sensors started at 100 Hz and 16 g. */
void gf_adxl345_test_start(gf_adxl345_t *sensors, gf_adxl345_test_t *test);

/* One step, every 10 ms; 1 when it is done: tested, passed and change are set, and the sensors are to be started anew. */
int gf_adxl345_test_step(gf_adxl345_t *sensors, gf_adxl345_test_t *test);

#endif
