#ifndef GF_RING_H
#define GF_RING_H

/* Rings between one interrupt and the main loop: one side only puts, the other only takes, nobody locks. */

#include "gf_bus.h"

typedef struct {
  volatile uint8_t *bytes; /* size is a power of two */
  uint32_t size;
  volatile uint32_t put;   /* bytes ever put */
  volatile uint32_t taken; /* bytes ever taken */
  volatile uint32_t lost;  /* put refused */
} gf_ring_t;

/* An empty ring over memory of the caller; size is a power of two. */
void gf_ring_start(gf_ring_t *ring, volatile uint8_t *bytes, uint32_t size);

uint32_t gf_ring_used(const gf_ring_t *ring);

/* One byte; 0 and counted in `lost` when full. */
int gf_ring_put(gf_ring_t *ring, uint8_t byte);

/* All of them or none; refusing is not counted in `lost`: the caller knows. */
int gf_ring_put_all(gf_ring_t *ring, const uint8_t *bytes, size_t size);

/* At most size bytes; returns how many. */
size_t gf_ring_take(gf_ring_t *ring, uint8_t *bytes, size_t size);

enum { GF_PULSES = 64 };

typedef struct {
  volatile gf_pulse_t pulses[GF_PULSES];
  volatile uint32_t put;
  volatile uint32_t taken;
  volatile uint32_t lost;
} gf_pulses_t; /* all zero is empty */

void gf_pulses_put(gf_pulses_t *pulses, uint64_t ticks, uint8_t edge);

/* The functions of gf_capture_t; the context is a gf_pulses_t. */
int gf_pulses_next(void *context, gf_pulse_t *pulse);
uint32_t gf_pulses_overflows(void *context);

#endif
