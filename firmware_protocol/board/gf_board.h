#ifndef GF_BOARD_H
#define GF_BOARD_H

/*
 * The board, without its processor: samples on a grid of instants, frames to the host, commands from it.
 *
 * The port calls gf_board_tick() from the interrupt of each sampling instant and gf_board_step() from its main loop.
 * All that the two share passes through a ring of samples and counters that only the tick writes.
 */

#include "gf_adxl345.h"
#include "gf_analog.h"
#include "gf_bus.h"
#include "gf_command.h"
#include "gf_sender.h"
#include "gf_stream.h"

enum {
  GF_BOARD_SAMPLES = 64, /* a power of two */
  GF_BOARD_LPC1768 = 0,
  GF_BOARD_EMULATED = 3,
  GF_VERSION_MAJOR = 0,
  GF_VERSION_MINOR = 2,
  GF_VERSION_PATCH = 0
};

/* What a port provides. */
typedef struct {
  void *context;
  gf_spi_t spi;
  gf_adc_t adc;
  gf_line_t host;
  gf_line_t gnss;
  gf_capture_t tacho;
  gf_capture_t pps;
  uint32_t tick_hz;                                         /* a multiple of 1 MHz */
  uint64_t (*now)(void *context);                           /* ticks since boot, never backwards */
  void (*set_period)(void *context, uint32_t ticks);        /* call gf_board_tick() so often; 0: no more */
  uint64_t (*idle_ticks)(void *context);                    /* ticks asleep since boot */
  uint32_t (*free_stack)(void *context);                    /* bytes never used */
  void (*reboot)(void *context);
  uint8_t uid[16];
  uint8_t firmware[20];
  uint8_t epoch;
  uint8_t simulated; /* 1: signals are not of a cube of metal */
  uint8_t bus_of[GF_SENSORS];
} gf_port_t;

typedef struct {
  uint64_t ticks;
  uint32_t index;
  int16_t counts[GF_AXES];
  uint16_t analog[GF_ADC_CHANNELS];
  uint8_t alive;
  uint8_t stale;
} gf_sample_t;

typedef struct {
  gf_port_t port;
  gf_settings_t settings;
  gf_sender_t sender;
  gf_decoder_t decoder;
  gf_adxl345_t sensors;
  gf_analog_t analog;
  gf_tacho_t tacho;
  gf_pps_t pps;
  gf_gnss_t gnss;
  gf_adxl345_test_t test;
  gf_command_t asked; /* the self-test's command, for its ACK */
  uint8_t running;
  volatile uint8_t testing; /* 1 in the test, 2 done */

  /* written by the tick */
  gf_sample_t ring[GF_BOARD_SAMPLES];
  volatile uint32_t put;
  volatile uint32_t taken; /* by the main loop */
  volatile uint32_t samples;
  volatile uint32_t missed;
  volatile uint32_t drops;
  uint32_t instants;  /* since boot, the index of samples */
  uint32_t until_try; /* instants until missing sensors are tried again */
  uint32_t rate_hz;
  uint32_t period_ns;

  /* frames being filled */
  gf_batch_t acc;
  gf_batch_t adc;
  uint32_t next_index;
  uint8_t acc_alive;
  uint8_t adc_mask;
  uint32_t batch;

  uint64_t next_hello; /* ticks */
  uint64_t next_status;
  uint64_t load_from; /* idle ticks and time of the last STATUS */
  uint64_t load_at;
  uint32_t permille;
  uint32_t rx_ok;
  uint32_t rx_bad;
} gf_board_t;

/* Start everything and begin to sample.  board->port is filled in; the rest of *board is zero. */
void gf_board_start(gf_board_t *board);

/* The instant at `ticks`; `missed` instants before it were not served. */
void gf_board_tick(gf_board_t *board, uint64_t ticks, uint32_t missed);

/* Do what there is to do, without waiting.  Call it whenever something happened, and every 10 ms. */
void gf_board_step(gf_board_t *board);

#endif
