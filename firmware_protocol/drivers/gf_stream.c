#include "gf_stream.h"

static const uint32_t mega = 1000000u;

uint64_t gf_ticks_to_us(uint64_t ticks, uint32_t tick_hz) { return ticks / (tick_hz / mega); }

static int is_due(const gf_batch_t *frame, uint64_t now, uint32_t tick_hz) {
  return gf_ticks_to_us(now, tick_hz) >= frame->t_us + GF_STREAM_WAIT_US;
}

/* ---- tachometer ---- */

void gf_tacho_start(gf_tacho_t *tacho, const gf_capture_t *capture, uint32_t tick_hz) {
  tacho->capture = capture;
  tacho->tick_hz = tick_hz;
  tacho->total = 0;
  tacho->holds = 0;
  tacho->ready = 0;
  tacho->frame.n = 0;
}

/* The pulses of a frame are counted on, alike, and within the 42 s that an offset can say. */
static int fits(const gf_tacho_t *tacho, const gf_pulse_t *pulse) {
  const uint64_t longest = (uint64_t)tacho->tick_hz * 40u;
  return tacho->frame.n == 0u || (pulse->index == tacho->total && pulse->edge == tacho->edge &&
                                  pulse->ticks - tacho->first_ticks < longest);
}

static void add_pulse(gf_tacho_t *tacho, const gf_pulse_t *pulse) {
  const uint64_t per_us = tacho->tick_hz / mega;
  if (tacho->frame.n == 0u) {
    const uint64_t t_us = gf_ticks_to_us(pulse->ticks, tacho->tick_hz);
    tacho->first_ticks = t_us * per_us;
    tacho->edge = pulse->edge;
    gf_tacho_begin(&tacho->frame, t_us, pulse->index, pulse->edge);
  }
  (void)gf_tacho_pulse(&tacho->frame, (uint32_t)((pulse->ticks - tacho->first_ticks) * 100u / per_us));
  tacho->total = pulse->index + 1u;
}

int gf_tacho_poll(gf_tacho_t *tacho, uint64_t now) {
  if (tacho->ready) {
    tacho->ready = 0;
    tacho->frame.n = 0;
  }
  while (!tacho->ready) {
    if (!tacho->holds) {
      tacho->holds = tacho->capture->next(tacho->capture->context, &tacho->held);
    }
    if (!tacho->holds) {
      break;
    }
    if (!fits(tacho, &tacho->held)) {
      tacho->ready = 1;
    } else {
      tacho->holds = 0;
      add_pulse(tacho, &tacho->held);
      tacho->ready = tacho->frame.n >= GF_TACHO_FRAME_PULSES;
    }
  }
  tacho->ready = tacho->ready || (tacho->frame.n != 0u && is_due(&tacho->frame, now, tacho->tick_hz));
  return tacho->ready;
}

/* ---- pulse per second ---- */

void gf_pps_start(gf_pps_t *pps, const gf_capture_t *capture, uint32_t tick_hz) {
  pps->capture = capture;
  pps->tick_hz = tick_hz;
  pps->total = 0;
  pps->t_us = 0;
}

int gf_pps_poll(gf_pps_t *pps) {
  const uint32_t per_us = pps->tick_hz / mega;
  gf_pulse_t pulse;
  uint32_t rest;
  if (!pps->capture->next(pps->capture->context, &pulse)) {
    return 0;
  }
  pps->t_us = gf_ticks_to_us(pulse.ticks, pps->tick_hz);
  rest = (uint32_t)(pulse.ticks - pps->t_us * per_us);
  (void)gf_pack_pps(pps->payload, pulse.index, rest * 1000u / per_us, 0);
  pps->total = pulse.index + 1u;
  return 1;
}

/* ---- GNSS receiver ---- */

void gf_gnss_start(gf_gnss_t *gnss, const gf_line_t *line, uint32_t tick_hz) {
  gnss->line = line;
  gnss->tick_hz = tick_hz;
  gnss->total = 0;
  gnss->ready = 0;
  gf_gps_begin(&gnss->frame, 0);
}

int gf_gnss_poll(gf_gnss_t *gnss, uint64_t now) {
  uint8_t bytes[32];
  size_t n = 1;
  if (gnss->ready) {
    gnss->ready = 0;
    gf_gps_begin(&gnss->frame, 0);
  }
  while (gnss->frame.size < GF_GPS_FRAME_BYTES && n != 0u) {
    n = gnss->line->read(gnss->line->context, bytes, sizeof bytes);
    if (n != 0u && gnss->frame.size == 0u) {
      gf_gps_begin(&gnss->frame, gf_ticks_to_us(now, gnss->tick_hz));
    }
    for (size_t i = 0; i < n; i++) {
      (void)gf_gps_byte(&gnss->frame, bytes[i]); /* 240 + 32 bytes always fit */
    }
    gnss->total += (uint32_t)n;
  }
  gnss->ready = gnss->frame.size >= GF_GPS_FRAME_BYTES ||
                (gnss->frame.size != 0u && is_due(&gnss->frame, now, gnss->tick_hz));
  return gnss->ready;
}
