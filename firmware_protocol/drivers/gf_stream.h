#ifndef GF_STREAM_H
#define GF_STREAM_H

/*
 * What arrives on its own: tachometer pulses, pulses per second, bytes of the GNSS receiver.  Each is polled, gathers what came, and
 * says when a payload is ready to be sent.  Times are ticks of the port's timer.
 */

#include "gf_bus.h"
#include "gf_payload.h"

enum {
  GF_TACHO_FRAME_PULSES = 32,
  GF_GPS_FRAME_BYTES = 240,
  GF_STREAM_WAIT_US = 20000 /* what has waited this long is sent */
};

typedef struct {
  const gf_capture_t *capture;
  uint32_t tick_hz;
  uint32_t total;       /* pulses captured so far, with those that were not kept */
  int holds;            /* a pulse that did not fit the frame before */
  gf_pulse_t held;
  int ready;            /* the frame was handed out */
  uint64_t first_ticks; /* of the frame's t_us, whole microseconds */
  uint8_t edge;         /* of the frame */
  gf_batch_t frame;
} gf_tacho_t;

void gf_tacho_start(gf_tacho_t *tacho, const gf_capture_t *capture, uint32_t tick_hz);

/* 1 when tacho->frame is to be sent, before the next call; call again until 0. */
int gf_tacho_poll(gf_tacho_t *tacho, uint64_t now);

typedef struct {
  const gf_capture_t *capture;
  uint32_t tick_hz;
  uint32_t total;
  uint64_t t_us;
  uint8_t payload[GF_PPS_SIZE];
} gf_pps_t;

void gf_pps_start(gf_pps_t *pps, const gf_capture_t *capture, uint32_t tick_hz);

/* 1 when pps->payload is to be sent with pps->t_us, before the next call; call again until 0. */
int gf_pps_poll(gf_pps_t *pps);

typedef struct {
  const gf_line_t *line;
  uint32_t tick_hz;
  uint32_t total;
  int ready;
  gf_batch_t frame;
} gf_gnss_t;

void gf_gnss_start(gf_gnss_t *gnss, const gf_line_t *line, uint32_t tick_hz);

/* 1 when gnss->frame is to be sent, before the next call; call again until 0. */
int gf_gnss_poll(gf_gnss_t *gnss, uint64_t now);

/* Microseconds of a tick count; tick_hz is a multiple of 1 MHz. */
uint64_t gf_ticks_to_us(uint64_t ticks, uint32_t tick_hz);

#endif
