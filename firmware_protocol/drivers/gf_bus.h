#ifndef GF_BUS_H
#define GF_BUS_H

/*
 * What the drivers ask of a port: functions and the context that they get as their first argument.  A port fills these
 * in for its registers, a test for its models.
 */

#include <stddef.h>
#include <stdint.h>

enum { GF_SPI_DEVICES = 4, GF_SPI_WORDS = 8 };

typedef struct {
  void *context;
  /*
   * Send the same n <= GF_SPI_WORDS 16-bit words, mode 3, to every device of the mask, each under its own chip select, and
   * put what device i answered into in[i].  Devices on different buses may be served at once.  Returns the mask of
   * devices whose transfer was completed.
   */
  uint8_t (*exchange)(void *context, uint8_t device_mask, const uint16_t *out, uint16_t in[][GF_SPI_WORDS],
                      uint8_t n);
  /* Return after at least 5 us: an ADXL345 needs them from the end of a sample until its FIFO shows the next. */
  void (*pause)(void *context);
} gf_spi_t;

typedef struct {
  void *context;
  /* The newest 12-bit conversion of every channel of the mask into values[channel]; returns the mask of channels
   * converted since the last call. */
  uint8_t (*read)(void *context, uint8_t channel_mask, uint16_t *values);
} gf_adc_t;

typedef struct {
  void *context;
  /* Take all bytes and return 1, or none and 0. */
  int (*write)(void *context, const uint8_t *bytes, size_t size);
  /* At most size received bytes; returns how many. */
  size_t (*read)(void *context, uint8_t *bytes, size_t size);
  /* 1 when the clock can make this rate within 2 %. */
  int (*can_baud)(void *context, uint32_t baud);
  /* Change to such a rate once what was written so far has left. */
  void (*set_baud)(void *context, uint32_t baud);
  /* Framing, parity and overrun errors, and bytes lost to a full buffer, since boot. */
  uint32_t (*errors)(void *context);
} gf_line_t;

typedef struct {
  uint64_t ticks; /* of the port's timer since boot */
  uint32_t index; /* pulses captured before it, with those that were not kept */
  uint8_t edge;   /* as in TACHO: bit 0 rising, bit 1 direction known, bit 2 negative */
} gf_pulse_t;

typedef struct {
  void *context;
  /* The oldest captured pulse: 1, or 0 when there is none. */
  int (*next)(void *context, gf_pulse_t *pulse);
  /* Pulses captured and not kept, since boot. */
  uint32_t (*overflows)(void *context);
} gf_capture_t;

#endif
